"""The gaps bend along with their chambers."""

from __future__ import annotations

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "gap_bending",
    "body",
    (EffectParameter("ratio", "", 0.6),),
    what="the gaps bend along with their chambers instead of staying straight",
    look="hold one segment under pressure and look at its gaps from above",
    gap_ratio=lambda e: e["ratio"],
)

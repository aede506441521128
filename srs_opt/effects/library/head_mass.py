"""The head is heavier than documented."""

from __future__ import annotations

from srs_opt.effects.effect import Effect, on_link
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "head_mass",
    "body",
    (EffectParameter("extra_kg", "kg", 0.02),),
    what="the head link carries more (or less) mass than documented",
    look="put a scale under the head's wheels",
    instrument="head_load_n",
    extra_mass=lambda e, n: on_link(n, n - 1, e["extra_kg"]),
)

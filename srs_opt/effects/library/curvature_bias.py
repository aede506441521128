"""All segments are bent at rest."""

from __future__ import annotations

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "curvature_bias",
    "actuation",
    (EffectParameter("bias", "1/m", 1.2),),
    what="all segments lean to the same side, also without pressure (uneven constraint layers)",
    look="lift the vented robot and look along it; pressurize one segment at a time, left and right",
    bias=lambda e: e["bias"],
)

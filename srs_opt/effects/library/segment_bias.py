"""One segment is bent at rest."""

from __future__ import annotations

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter, segment

EFFECT = Effect(
    "segment_bias",
    "actuation",
    (EffectParameter("bias", "1/m", 3.0), segment()),
    what="one segment leans to one side, also without pressure (uneven constraint layer)",
    look="lift the vented robot and look along it; pressurize that segment left and right",
    bias=lambda e: e["bias"],
)

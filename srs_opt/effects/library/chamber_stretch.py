"""Chambers lengthen under the pressure that bends them."""

from __future__ import annotations

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "chamber_stretch",
    "body",
    (EffectParameter("per_curv2", "m^2", 2e-4, lower=0),),
    what="chambers lengthen under pressure, by the square of their curvature without load",
    look="press one lifted segment and measure its arc against that at rest",
    stretch=lambda e, no_load: e["per_curv2"] * no_load**2,
)

"""All wheels stand askew by the same angle."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "wheel_toe",
    "ground",
    (EffectParameter("angle", "rad", 0.03),),
    what="every wheel pair stands askew against its link by the same angle, counter-clockwise",
    look="push the unpowered robot along a straight edge: it drifts to one side",
    wheel_angle=lambda e, n: e["angle"] * ca.SX.ones(n, 1),
)

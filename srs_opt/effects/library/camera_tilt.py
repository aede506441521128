"""The camera looks at the floor askew."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect, Symbols
from srs_opt.effects.parameter import EffectParameter


def _camera(e: Symbols, x: ca.SX, y: ca.SX) -> tuple[ca.SX, ca.SX]:
    factor = 1 + e["per_m"] * x
    return x * factor, y * factor


EFFECT = Effect(
    "camera_tilt",
    "measurement",
    (EffectParameter("per_m", "1/m", 0.03),),
    what="the picture's scale changes along x: the camera looks at the floor askew",
    look="lay a ruler into the picture at both ends of the field of view",
    instrument="ruler_scale_at_1m",
    camera=_camera,
)

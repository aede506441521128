"""The camera's scale is off."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect, Symbols
from srs_opt.effects.parameter import EffectParameter


def _camera(e: Symbols, x: ca.SX, y: ca.SX) -> tuple[ca.SX, ca.SX]:
    return x * (1 + e["scale"]), y * (1 + e["scale"])


EFFECT = Effect(
    "camera_scale",
    "measurement",
    (EffectParameter("scale", "", 0.03, lower=-1, exclusive=True),),
    what="the picture shows all lengths too long (or too short) by the same share",
    look="lay a ruler into the picture",
    instrument="ruler_scale",
    camera=_camera,
)

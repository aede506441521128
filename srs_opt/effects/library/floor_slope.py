"""The floor is not level."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect, LinkState, Symbols, to_body_frame
from srs_opt.effects.parameter import Direction, EffectParameter


def _force(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    # the load on the wheels keeps its size: cos(angle) is 1 to 2e-5 at the typical angle
    weight = s.mass * s.gravity * ca.sin(e["angle"])
    return to_body_frame(weight * ca.cos(e["direction"]), weight * ca.sin(e["direction"]), s.heading)


EFFECT = Effect(
    "floor_slope",
    "room",
    (EffectParameter("angle", "rad", 0.006, lower=0), Direction("direction", "rad", 0.0)),
    what="the floor slopes down towards `direction`",
    look="lay a level on the floor, or drive in four headings",
    instrument="floor_angle_rad",
    link_force=_force,
)

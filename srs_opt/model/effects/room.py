"""Effects that know where in the room the robot is: they break the periodic orbit."""

from __future__ import annotations

import casadi as ca

from srs_opt.model.effects.effect import Effect, EffectParameter, LinkState, Symbols
from srs_opt.model.effects.tether import on_link


def _to_body(fx: ca.SX, fy: ca.SX, heading: ca.SX) -> tuple[ca.SX, ca.SX]:
    c, s = ca.cos(heading), ca.sin(heading)
    return c * fx + s * fy, c * fy - s * fx


def _pull(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    dx, dy = e["ax_m"] - s.room_x[0], e["ay_m"] - s.room_y[0]
    # one micrometre keeps the direction defined on the anchor itself
    scale = e["force_n"] / ca.sqrt(dx**2 + dy**2 + 1e-12)
    fx, fy = _to_body(scale * dx, scale * dy, s.heading)
    n = s.v_x.shape[0]
    return on_link(n, 0, fx), on_link(n, 0, fy)


def _slope(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    weight = s.mass * s.gravity * ca.sin(e["angle"])
    return _to_body(weight * ca.cos(e["direction"]), weight * ca.sin(e["direction"]), s.heading)


EFFECTS = (
    Effect(
        "tether_pull",
        "room",
        (
            EffectParameter("force_n", "N", 0.03, lower=0),
            EffectParameter("ax_m", "m", 0.0),
            EffectParameter("ay_m", "m", 1.0),
        ),
        link_force=_pull,
    ),
    Effect(
        "floor_slope",
        "room",
        (EffectParameter("angle", "rad", 0.006, lower=0), EffectParameter("direction", "rad", 0.0)),
        link_force=_slope,
    ),
)

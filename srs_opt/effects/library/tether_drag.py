"""The hose drags behind with a force that hardly depends on speed."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect, LinkState, Symbols, on_link
from srs_opt.effects.parameter import EffectParameter


def _force(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    v_x, v_y = s.v_x[0], s.v_y[0]
    # Coulomb friction against the tail's velocity, smoothed as the cone law of `model.friction`
    pull = -e["force_n"] / ca.sqrt(v_x**2 + v_y**2 + s.friction_speed**2)
    n = s.v_x.shape[0]
    return on_link(n, 0, pull * v_x), on_link(n, 0, pull * v_y)


EFFECT = Effect(
    "tether_drag",
    "tether",
    (EffectParameter("force_n", "N", 0.035, lower=0),),
    what="the hose slides on the floor behind the tail: dry friction against the tail's motion",
    look="drive once with the hose held up, or tow the robot with and without its hose at several speeds",
    link_force=_force,
)

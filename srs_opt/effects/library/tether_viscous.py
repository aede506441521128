"""The hose drags behind with a force that grows with speed."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect, LinkState, Symbols, on_link
from srs_opt.effects.parameter import EffectParameter


def _force(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    n = s.v_x.shape[0]
    return on_link(n, 0, -e["damping"] * s.v_x[0]), on_link(n, 0, -e["damping"] * s.v_y[0])


EFFECT = Effect(
    "tether_viscous",
    "tether",
    (EffectParameter("damping", "N s/m", 0.25, lower=0),),
    what="the hose resists the tail's motion in proportion to its speed",
    look="tow the robot with and without its hose at several speeds: the difference grows with speed",
    link_force=_force,
)

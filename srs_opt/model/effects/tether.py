"""The air supply's tether: drag, viscous drag, weight, all on the tail (link 1)."""

from __future__ import annotations

import casadi as ca

from srs_opt.model.effects.effect import Effect, EffectParameter, LinkState, Symbols


def on_link(count: int, index: int, value: ca.SX) -> ca.SX:
    """Return a vector over all links with `value` on one of them."""
    vector = ca.SX.zeros(count, 1)
    vector[index] = value
    return vector


def _drag(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    v_x, v_y = s.v_x[0], s.v_y[0]
    pull = -e["force_n"] / ca.sqrt(v_x**2 + v_y**2 + s.friction_speed**2)
    n = s.v_x.shape[0]
    return on_link(n, 0, pull * v_x), on_link(n, 0, pull * v_y)


def _viscous(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    n = s.v_x.shape[0]
    return on_link(n, 0, -e["damping"] * s.v_x[0]), on_link(n, 0, -e["damping"] * s.v_y[0])


EFFECTS = (
    Effect("tether_drag", "tether", (EffectParameter("force_n", "N", 0.035, lower=0),), link_force=_drag),
    Effect(
        "tether_viscous", "tether", (EffectParameter("damping", "N s/m", 0.25, lower=0),), link_force=_viscous
    ),
    Effect(
        "tether_weight",
        "tether",
        (EffectParameter("load_n", "N", 0.20, lower=0),),
        extra_load=lambda e, n: on_link(n, 0, e["load_n"]),
    ),
)

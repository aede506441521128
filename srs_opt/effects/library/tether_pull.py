"""The taut hose pulls the tail towards where it is fixed."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect, LinkState, Symbols, on_link, to_body_frame
from srs_opt.effects.parameter import EffectParameter, Towards


def _force(e: Symbols, s: LinkState) -> tuple[ca.SX, ca.SX]:
    dx, dy = e["ax_m"] - s.room_x[0], e["ay_m"] - s.room_y[0]
    # one micrometre keeps the direction defined on the anchor itself
    scale = e["force_n"] / ca.sqrt(dx**2 + dy**2 + 1e-12)
    fx, fy = to_body_frame(scale * dx, scale * dy, s.heading)
    n = s.v_x.shape[0]
    return on_link(n, 0, fx), on_link(n, 0, fy)


EFFECT = Effect(
    "tether_pull",
    "room",
    (
        EffectParameter("force_n", "N", 0.03, lower=0),
        Towards("ax_m", "m", 0.0),
        Towards("ay_m", "m", 1.0),
    ),
    what="the hose is taut and pulls the tail towards the point where it is fixed",
    look="drive in four headings, or take the hose off: the pull keeps its place in the room",
    through_tether=True,
    link_force=_force,
)

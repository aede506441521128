"""Markers do not sit on the link centres."""

from __future__ import annotations

import casadi as ca

from srs_opt.model.effects.effect import Effect, Symbols
from srs_opt.model.effects.parameter import Component, EffectParameter


def _marker(e: Symbols, x: ca.SX, y: ca.SX, theta: ca.SX) -> tuple[ca.SX, ca.SX]:
    c, s = ca.cos(theta), ca.sin(theta)
    return x + c * e["dx_m"] - s * e["dy_m"], y + s * e["dx_m"] + c * e["dy_m"]


EFFECT = Effect(
    "marker_offset",
    "measurement",
    (EffectParameter("dx_m", "m", 0.004), Component("dy_m", "m", 0.004)),
    what="all markers sit beside their link centres by the same offset, in the link's axes",
    look="measure where the markers sit on their links",
    marker=_marker,
)

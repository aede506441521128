"""Markers do not sit on the link centres."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect, Symbols
from srs_opt.effects.parameter import Component, EffectParameter
from srs_opt.geometry import turn_by


def _marker(e: Symbols, x: ca.SX, y: ca.SX, theta: ca.SX) -> tuple[ca.SX, ca.SX]:
    dx, dy = turn_by(ca.cos(theta), ca.sin(theta), e["dx_m"], e["dy_m"])
    return x + dx, y + dy


EFFECT = Effect(
    "marker_offset",
    "measurement",
    (EffectParameter("dx_m", "m", 0.004), Component("dy_m", "m", 0.004)),
    what="all markers sit beside their link centres by the same offset, in the link's axes",
    look="measure where the markers sit on their links",
    marker=_marker,
)

"""Emptying is slower (or faster) than filling."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect, Symbols
from srs_opt.effects.parameter import EffectParameter

# Sign changes of the bend are spread over this curvature (1/m), half a per mille of a full bend, and lie on
# the negative side: a straight segment does not bend against its valve, so a start from rest is exact.
_SIGN_WIDTH_1_M = 0.01


def _slow_down(e: Symbols, valve: ca.SX, kappa: ca.SX) -> ca.SX:
    against = 0.5 * (1 - ca.tanh(valve * kappa / _SIGN_WIDTH_1_M + 2))
    return 1 + e["ratio"] * against * valve * valve  # a vented segment bends against nothing


EFFECT = Effect(
    "fill_exhaust_asymmetry",
    "actuation",
    (EffectParameter("ratio", "", 0.5, lower=-1, exclusive=True),),
    what="a segment unbends more slowly (or faster) than it bends: chambers fill and exhaust differently",
    look="film a step of one segment, on and off, and compare both time constants",
    slow_down=_slow_down,
)

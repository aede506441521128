"""Emptying is slower (or faster) than filling."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect, Symbols
from srs_opt.effects.parameter import EffectParameter
from srs_opt.effects.settings import SMOOTHING


def _slow_down(e: Symbols, valve: ca.SX, kappa: ca.SX) -> ca.SX:
    # + 2: the change of sign lies on the negative side, so that a straight segment (kappa 0) does not bend
    # against its valve and a start from rest is exact
    against = 0.5 * (1 - ca.tanh(valve * kappa / SMOOTHING.curvature_1_m + 2))
    return 1 + e["ratio"] * against * valve * valve  # a vented segment bends against nothing


EFFECT = Effect(
    "fill_exhaust_asymmetry",
    "actuation",
    (EffectParameter("ratio", "", 0.5, lower=-1, exclusive=True),),
    what="a segment unbends more slowly (or faster) than it bends: chambers fill and exhaust differently",
    look="film a step of one segment, on and off, and compare both time constants",
    slow_down=_slow_down,
)

"""Wheels resist rolling backwards more than forwards."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

# half the width of the change from one coefficient to the other, a tenth of the usual smoothing of the
# Coulomb term, which is itself near zero there; with ten times the width a trial moved by 0.08 mm
BLUR_M_S = 2e-4

EFFECT = Effect(
    "reverse_friction",
    "ground",
    (EffectParameter("excess", "", 2.0, lower=0),),
    what="a link that moves backwards along its wheels meets more friction than forwards, as with worn "
    "ratchets or with scales: the coefficient's excess over the forward one, as a share of it",
    look="tow the unpowered robot forwards and backwards: the forces differ",
    rolling_factor=lambda e, v: 1 + e["excess"] * (1 - ca.tanh(v / BLUR_M_S)) / 2,
)

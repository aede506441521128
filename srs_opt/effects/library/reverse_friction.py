"""Wheels resist rolling backwards more than forwards."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter
from srs_opt.effects.settings import SMOOTHING

EFFECT = Effect(
    "reverse_friction",
    "ground",
    (EffectParameter("excess", "", 2.0, lower=0),),
    what="a link that moves backwards along its wheels meets more friction than forwards, as with worn "
    "ratchets or with scales: the coefficient's excess over the forward one, as a share of it",
    look="tow the unpowered robot forwards and backwards: the forces differ",
    rolling_factor=lambda e, v: 1 + e["excess"] * (1 - ca.tanh(v / SMOOTHING.reversal_m_s)) / 2,
)

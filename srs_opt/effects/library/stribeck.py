"""Wheels resist rolling more at low speed."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter, Scale

EFFECT = Effect(
    "stribeck",
    "ground",
    (EffectParameter("excess", "", 1.0, lower=0), Scale("speed", "m/s", 0.08)),
    what="rolling friction is larger at low speed (breakaway) than when rolling",
    look="tow the robot at several speeds: the force falls as the speed rises",
    rolling_factor=lambda e, v: 1 + e["excess"] * ca.exp(-((v / e["speed"]) ** 2)),
)

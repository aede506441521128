"""Friction across the wheels grows with slip."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "slip_rate",
    "ground",
    (EffectParameter("per_speed", "s/m", 8.0),),
    what="friction across the wheels grows (or falls) with the speed of sliding",
    look="drag a wheel pair sideways at several speeds and read the force",
    skidding_factor=lambda e, v: 1 + e["per_speed"] * ca.fabs(v),
)

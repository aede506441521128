"""The ground under the wheels: friction that depends on speed."""

from __future__ import annotations

import casadi as ca

from srs_opt.model.effects.effect import Effect, EffectParameter

EFFECTS = (
    Effect(
        "viscous_rolling",
        "ground",
        (EffectParameter("damping", "N s/m", 0.06, lower=0),),
        rolling_force=lambda e, v: -e["damping"] * v,
    ),
    Effect(
        "stribeck",
        "ground",
        (
            EffectParameter("excess", "", 1.0, lower=0),
            EffectParameter("speed", "m/s", 0.08, lower=0, exclusive=True),
        ),
        rolling_factor=lambda e, v: 1 + e["excess"] * ca.exp(-((v / e["speed"]) ** 2)),
    ),
    Effect(
        "slip_rate",
        "ground",
        (EffectParameter("per_speed", "s/m", 8.0),),
        skidding_factor=lambda e, v: 1 + e["per_speed"] * ca.fabs(v),
    ),
)

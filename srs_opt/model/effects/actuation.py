"""Valves, air and silicone: what stands between the valve command and the curvature."""

from __future__ import annotations

import casadi as ca

from srs_opt.model.effects.effect import Effect, EffectParameter, Symbols

# Sign changes of the bend are spread over this curvature (1/m), half a per mille of a full bend, and lie on
# the negative side: a straight segment does not bend against its valve, so a start from rest is exact.
_SIGN_WIDTH_1_M = 0.01


def _asymmetry(e: Symbols, valve: ca.SX, kappa: ca.SX) -> ca.SX:
    against = 0.5 * (1 - ca.tanh(valve * kappa / _SIGN_WIDTH_1_M + 2))
    return 1 + e["ratio"] * against * valve * valve  # a vented segment bends against nothing


EFFECTS = (
    Effect(
        "bending_resistance",
        "actuation",
        (EffectParameter("ratio", "", 0.18, lower=0),),
        gain=lambda e, frequency: 1 / (1 + e["ratio"]),
    ),
    Effect("curvature_bias", "actuation", (EffectParameter("bias", "1/m", 1.2),), bias=lambda e: e["bias"]),
    Effect(
        "segment_bias",
        "actuation",
        (EffectParameter("bias", "1/m", 3.0), EffectParameter("segment", "", 1, place="segment")),
        bias=lambda e: e["bias"] * e["segment"],
    ),
    Effect(
        "dead_time",
        "actuation",
        (EffectParameter("delay_s", "s", 0.03, lower=0),),
        delay=lambda e: e["delay_s"],
    ),
    Effect(
        "fill_exhaust_asymmetry",
        "actuation",
        (EffectParameter("ratio", "", 0.5, lower=-1, exclusive=True),),
        slow_down=_asymmetry,
    ),
    Effect(
        "supply_droop",
        "actuation",
        (EffectParameter("per_hz", "1/Hz", 0.10, lower=0),),
        gain=lambda e, frequency: 1 - e["per_hz"] * frequency,
    ),
    Effect(
        "curvature_stiffening",
        "actuation",
        (EffectParameter("per_curv2", "m^2", 6e-4),),
        restoring=lambda e, kappa, memory: e["per_curv2"] * kappa**3,
    ),
    Effect(
        "hysteresis",
        "actuation",
        (
            EffectParameter("ratio", "", 0.35, lower=0),
            EffectParameter("width", "1/m", 4.0, lower=0, exclusive=True),
        ),
        restoring=lambda e, kappa, memory: e["ratio"] * memory,
        memory_rate=lambda e, dkappa, memory: dkappa - ca.fabs(dkappa) * memory / e["width"],
    ),
)

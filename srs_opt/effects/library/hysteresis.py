"""Curvature depends on where the segment came from."""

from __future__ import annotations

import casadi as ca

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter, Scale

EFFECT = Effect(
    "hysteresis",
    "actuation",
    (EffectParameter("ratio", "", 0.35, lower=0), Scale("width", "1/m", 4.0)),
    what="the curvature at a pressure depends on where the segment came from (internal friction)",
    look="raise and lower the pressure of one segment slowly and plot curvature over pressure",
    restoring=lambda e, kappa, memory: e["ratio"] * memory,
    # Dahl's model: the memory follows the curvature and saturates at the width, whatever the rate
    memory_rate=lambda e, dkappa, memory: dkappa - ca.fabs(dkappa) * memory / e["width"],
)

"""The body: gaps, a heavier head, wheels that stand askew."""

from __future__ import annotations

import casadi as ca

from srs_opt.model.effects.effect import Effect, EffectParameter
from srs_opt.model.effects.tether import on_link

EFFECTS = (
    Effect("gap_length", "body", (EffectParameter("extra_m", "m", 0.008),), gap_extra=lambda e: e["extra_m"]),
    Effect("gap_bending", "body", (EffectParameter("ratio", "", 0.6),), gap_ratio=lambda e: e["ratio"]),
    Effect(
        "head_mass",
        "body",
        (EffectParameter("extra_kg", "kg", 0.02),),
        extra_mass=lambda e, n: on_link(n, n - 1, e["extra_kg"]),
    ),
    Effect(
        "wheel_toe",
        "ground",
        (EffectParameter("angle", "rad", 0.03),),
        wheel_angle=lambda e, n: e["angle"] * ca.SX.ones(n, 1),
    ),
    Effect(
        "single_wheel_toe",
        "ground",
        (EffectParameter("angle", "rad", 0.10), EffectParameter("link", "", 1, place="link")),
        wheel_angle=lambda e, n: e["angle"] * e["link"],
    ),
)

"""Segments stiffen as they bend."""

from __future__ import annotations

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "curvature_stiffening",
    "actuation",
    (EffectParameter("per_curv2", "m^2", 6e-4),),
    what="segments stiffen (or soften) as they bend: curvature is not proportional to pressure",
    look="measure a lifted segment's final curvature at several pressures",
    restoring=lambda e, kappa, memory: e["per_curv2"] * kappa**3,
)

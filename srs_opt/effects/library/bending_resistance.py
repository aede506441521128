"""The body resists bending beyond what the step response showed."""

from __future__ import annotations

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "bending_resistance",
    "actuation",
    (EffectParameter("ratio", "", 0.18, lower=0),),
    what="the segments bend less than the curvature per pressure of the bench, by a constant share",
    look="repeat the bench test of curvature over pressure on the assembled robot: only that tells it",
    gain=lambda e, frequency: 1 / (1 + e["ratio"]),
)

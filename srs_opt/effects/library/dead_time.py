"""Valves follow their commands late."""

from __future__ import annotations

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "dead_time",
    "actuation",
    (EffectParameter("delay_s", "s", 0.03, lower=0),),
    what="all valves follow their commands late by the same time",
    look="film a light that shows the valve command: only it tells a late valve from a late clock",
    delay=lambda e: e["delay_s"],
)

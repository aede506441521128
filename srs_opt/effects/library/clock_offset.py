"""The camera's clock runs ahead of the valves' or behind."""

from __future__ import annotations

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "clock_offset",
    "clock",
    (EffectParameter("offset_s", "s", 0.03),),
    what="the camera's clock and the valves' differ by a constant time",
    look="film a light that shows the valve command",
    instrument="valve_light_delay_s",
    clock=lambda e: e["offset_s"],
)

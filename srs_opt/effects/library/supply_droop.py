"""The supply gives less the faster the valves switch."""

from __future__ import annotations

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "supply_droop",
    "actuation",
    (EffectParameter("per_hz", "1/Hz", 0.10, lower=0),),
    what="the faster the gait, the less pressure the supply delivers",
    look="log the pressure behind the regulator at several gait frequencies",
    gain=lambda e, frequency: 1 - e["per_hz"] * frequency,
)

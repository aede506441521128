"""The gaps between the chambers are longer than documented."""

from __future__ import annotations

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "gap_length",
    "body",
    (EffectParameter("extra_m", "m", 0.008),),
    what="the unactuated gaps between the chambers are longer (or shorter) than documented",
    look="measure the distance between wheel pairs; a ruler in the picture tells it from camera_scale",
    gap_extra=lambda e: e["extra_m"],
)

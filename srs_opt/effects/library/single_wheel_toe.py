"""One wheel pair stands askew."""

from __future__ import annotations

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter, link

EFFECT = Effect(
    "single_wheel_toe",
    "ground",
    (EffectParameter("angle", "rad", 0.10), link()),
    what="one wheel pair stands askew against its link, counter-clockwise",
    look="push the unpowered robot: it curves; sight along the wheels of that link",
    wheel_angle=lambda e, n: e["angle"],
)

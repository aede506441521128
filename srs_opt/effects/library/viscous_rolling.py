"""Wheels resist rolling in proportion to speed."""

from __future__ import annotations

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "viscous_rolling",
    "ground",
    (EffectParameter("damping", "N s/m", 0.06, lower=0),),
    what="rolling resistance grows with speed on every wheel pair, as with greased bearings",
    look="tow the robot without its hose at several speeds: the force grows in proportion",
    rolling_force=lambda e, v: -e["damping"] * v,
)

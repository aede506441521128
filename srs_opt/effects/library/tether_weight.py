"""The hose hangs on the tail and presses it down."""

from __future__ import annotations

from srs_opt.effects.effect import Effect, on_link
from srs_opt.effects.parameter import EffectParameter

EFFECT = Effect(
    "tether_weight",
    "tether",
    (EffectParameter("load_n", "N", 0.20, lower=0),),
    what="the hose rests on the tail: its wheels carry more, the tail's mass is unchanged",
    look="put a scale under the tail's wheels, with the hose as it hangs in the trials",
    instrument="tail_load_n",
    extra_load=lambda e, n: on_link(n, 0, e["load_n"]),
)

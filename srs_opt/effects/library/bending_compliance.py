"""The segments bend under load: 1/EI grows by the flexibility."""

from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter, Scale

EFFECT = Effect(
    name="bending_compliance",
    kind="actuation",
    parameters=(
        EffectParameter("flexibility", "1/(N m^2)", 200.0, lower=0),
        Scale("relaxation_s", "s", 0.005),
    ),
    what="the segments bend under load instead of following their pressure whatever the ground does",
    look="press a segment alone, lifted and on the ground: on the ground it bends less, by its stiffness",
    instrument="bending_flexibility_1_n_m2",
    flexibility=lambda e: e["flexibility"],
    relaxation=lambda e: e["relaxation_s"],
)

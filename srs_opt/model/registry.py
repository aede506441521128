"""The models by name; a third model is one new file and one line here."""

from __future__ import annotations

from functools import lru_cache

from srs_opt.document import unknown_word
from srs_opt.errors import InputError
from srs_opt.model.actuator import Actuator
from srs_opt.model.complex import ComplexModel
from srs_opt.model.compliant import CompliantModel
from srs_opt.model.mechanics import Mechanics
from srs_opt.model.parameters import Parameters, Structure
from srs_opt.model.simplified import SimplifiedModel
from srs_opt.model.state import StateLayout

MODELS: dict[str, type[Mechanics]] = {
    "complex": ComplexModel,
    "simplified": SimplifiedModel,
    "compliant": CompliantModel,
}


@lru_cache(maxsize=64)
def build(structure: Structure) -> tuple[Parameters, Mechanics, Actuator]:
    """Return the symbols, the mechanics and the actuators of one structure.

    Raises
    ------
    InputError
        For an unknown model name.
    """
    if structure.model not in MODELS:
        raise InputError(unknown_word("model", structure.model, sorted(MODELS)))
    parameters = Parameters(structure)
    return parameters, MODELS[structure.model](parameters), Actuator(parameters)


def state_layout(structure: Structure) -> StateLayout:
    """Return where things stand in the state of one structure."""
    _, mechanics, actuator = build(structure)
    return StateLayout(structure.segments, structure.compliant, actuator.states, mechanics.stretches)

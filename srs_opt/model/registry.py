"""The dynamic models by name: the library's, and those that plugins and installed packages register."""

from __future__ import annotations

from functools import lru_cache

from srs_opt.model.actuator import Actuator
from srs_opt.model.complex import ComplexModel
from srs_opt.model.compliant import CompliantModel
from srs_opt.model.mechanics import Mechanics
from srs_opt.model.parameters import Parameters, Structure
from srs_opt.model.simplified import SimplifiedModel
from srs_opt.model.state import StateLayout
from srs_opt.registry import Registry

MODELS: Registry[type[Mechanics]] = Registry(
    "model",
    lambda: {model.name: model for model in (ComplexModel, SimplifiedModel, CompliantModel)},
    lambda thing: isinstance(thing, type) and issubclass(thing, Mechanics) and thing is not Mechanics,
)


def register_model(model: type[Mechanics]) -> type[Mechanics]:
    """Make a dynamic model of your own known: ``--model NAME`` then takes it.

    It is a subclass of `Mechanics` with a `name` and the three methods of the yaw equation; its curvature is
    that of the actuators.

    Raises
    ------
    InputError
        If the name is taken or no plain word.
    """
    return MODELS.register(model)


@lru_cache(maxsize=64)
def build(structure: Structure) -> tuple[Parameters, Mechanics, Actuator]:
    """Return the symbols, the mechanics and the actuators of one structure.

    Raises
    ------
    InputError
        For an unknown model name.
    """
    model = MODELS.named(structure.model)
    parameters = Parameters(structure)
    return parameters, model(parameters), Actuator(parameters)


def state_layout(structure: Structure) -> StateLayout:
    """Return where things stand in the state of one structure."""
    _, mechanics, actuator = build(structure)
    return StateLayout(structure.segments, structure.compliant, actuator.states, mechanics.stretches)

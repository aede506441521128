"""Objectives by name: the built-in ones, and those that plugins and installed packages register."""

from __future__ import annotations

from collections.abc import Mapping

from srs_opt.gait_opt.objectives.objective import Objective
from srs_opt.registry import Registry


def _library() -> Mapping[str, Objective]:
    from srs_opt.gait_opt.objectives import built_in

    return {value.name: value for value in vars(built_in).values() if isinstance(value, Objective)}


OBJECTIVES: Registry[Objective] = Registry("objective", _library, lambda thing: isinstance(thing, Objective))


def register_objective(objective: Objective) -> Objective:
    """Make an objective of your own known: ``gait_opt --objective NAME`` then takes it.

    Call it in a file that commands are given with ``--plugin``, or in a program. A package that is installed
    offers its objectives as entry points of the group ``srs_opt.objectives``.

    Raises
    ------
    InputError
        If the name is taken or no plain word.
    """
    return OBJECTIVES.register(objective)


def objective_named(name: str) -> Objective:
    """Return the objective with this name.

    Raises
    ------
    InputError
        If there is none.
    """
    return OBJECTIVES.named(name)

"""Objectives by name: the built-in ones, and those that plugins and installed packages register."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import lru_cache
from types import MappingProxyType, ModuleType

from srs_opt import plugins
from srs_opt.errors import InputError
from srs_opt.gait_opt.objectives.objective import Objective

GROUP = "srs_opt.objectives"
_own: dict[str, Objective] = {}
_asked_packages: list[str] = []


@lru_cache(maxsize=1)
def built_in() -> Mapping[str, Objective]:
    """Return the library's objectives by name."""
    from srs_opt.gait_opt.objectives import built_in as library

    found = [value for value in vars(library).values() if isinstance(value, Objective)]
    return MappingProxyType({objective.name: objective for objective in found})


def all_objectives() -> Mapping[str, Objective]:
    """Return every known objective by name, own ones last."""
    if not _asked_packages:
        _asked_packages.append(GROUP)
        for _, offered in plugins.entry_points(GROUP):
            found = vars(offered).values() if isinstance(offered, ModuleType) else offered
            for objective in found if isinstance(found, Iterable) else (found,):
                if isinstance(objective, Objective):
                    register_objective(objective)
    return MappingProxyType({**built_in(), **_own})


def register_objective(objective: Objective) -> Objective:
    """Make an objective of your own known: ``gait_opt --objective NAME`` then takes it.

    Call it in a file that commands are given with ``--plugin``, or in a program. A package that is installed
    offers its objectives as entry points of the group ``srs_opt.objectives``.

    Raises
    ------
    InputError
        If the name is taken or no plain word.
    """
    name = objective.name
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise InputError(f"objective '{name}': expected a name of lower-case letters, digits and underscores")
    if name in built_in():
        raise InputError(f"objective '{name}' exists already; choose another name")
    if _own.setdefault(name, objective) != objective:
        raise InputError(f"objective '{name}' was registered before with another definition")
    return objective


def objective_named(name: str) -> Objective:
    """Return the objective with this name.

    Raises
    ------
    InputError
        If there is none.
    """
    known = all_objectives()
    if name not in known:
        raise InputError(
            f"objective must be one of {', '.join(known)}, found '{name}' (--plugin FILE.py adds your own)"
        )
    return known[name]

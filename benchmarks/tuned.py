"""What is tuned: every number of every `Settings` in the program, and how to try another value.

A class whose name ends in Settings is a frozen dataclass of tuned values; the module that defines or uses it
holds the instance that the program reads, at the time when it needs a value.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

PROGRAMS = ("srs_opt", "planners")


@dataclass(frozen=True)
class Tuned:
    """One tuned value.

    Attributes
    ----------
    module, instance, field : str
        Where it stands: ``module.instance.field``.
    """

    module: str
    instance: str
    field: str

    @property
    def name(self) -> str:
        """As it is told: instance and field."""
        return f"{self.instance}.{self.field}"

    @property
    def settings(self) -> Any:
        """Return the instance that the program reads."""
        return getattr(importlib.import_module(self.module), self.instance)

    @property
    def value(self) -> Any:
        """Return the value in force."""
        return getattr(self.settings, self.field)


def tuned_values() -> list[Tuned]:
    """Return all tuned numbers, and tuples of numbers, of the program."""
    found: dict[tuple[int, str], Tuned] = {}
    for module in _modules():
        for name, held in vars(module).items():
            if not name.isupper() or not is_settings(held):
                continue
            for field in fields(held):
                if _numbers(getattr(held, field.name)):
                    key = id(held), field.name
                    known = found.get(key)
                    # where it is defined, not where it is imported
                    if known is None or type(held).__module__ == module.__name__:
                        found[key] = Tuned(module.__name__, name, field.name)
    return sorted(found.values(), key=lambda t: (t.module, t.instance, t.field))


def is_settings(held: object) -> bool:
    """Return whether an object holds tuned values."""
    return is_dataclass(held) and not isinstance(held, type) and type(held).__name__.endswith("Settings")


def times(value: Any, factor: float) -> Any:
    """Return a value, or each of a tuple's, times `factor`; whole numbers stay whole and above zero."""
    if isinstance(value, tuple):
        return tuple(times(v, factor) for v in value)
    return max(1, round(value * factor)) if isinstance(value, int) and value else value * factor


@contextmanager
def changed(tuned: Tuned, value: Any) -> Iterator[None]:
    """Put another value in force. The instance is frozen for the program, not for a study of it."""
    held, before = tuned.settings, tuned.value
    object.__setattr__(held, tuned.field, value)
    try:
        yield
    finally:
        object.__setattr__(held, tuned.field, before)


@contextmanager
def reads(watched: Sequence[Tuned]) -> Iterator[set[Tuned]]:
    """Record which values are read meanwhile."""
    by_place = {(id(t.settings), t.field): t for t in watched}
    seen: set[Tuned] = set()
    classes = {type(t.settings) for t in watched}

    def recording(self: Any, name: str) -> Any:
        tuned = by_place.get((id(self), name))
        if tuned is not None:
            seen.add(tuned)
        return object.__getattribute__(self, name)

    for each in classes:
        each.__getattribute__ = recording  # type: ignore[method-assign]
    try:
        yield seen
    finally:
        for each in classes:
            del each.__getattribute__


def _modules() -> list[Any]:
    found = []
    for program in PROGRAMS:
        package = importlib.import_module(program)
        for info in pkgutil.walk_packages(package.__path__, f"{program}."):
            if not info.name.endswith("__main__"):
                found.append(importlib.import_module(info.name))
    return found


def _numbers(value: object) -> bool:
    if isinstance(value, tuple):
        return bool(value) and all(map(_numbers, value))
    return isinstance(value, (int, float)) and not isinstance(value, bool) and value not in (0, float("inf"))

"""A laboratory's own effects: registered from Python, by a plugin file, or by an installed package."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from srs_opt import plugins
from srs_opt.effects.effect import HOOKS, KINDS, Effect
from srs_opt.effects.parameter import Component, Direction, Place, Scale, Towards
from srs_opt.errors import InputError

GROUP = "srs_opt.effects"


@dataclass(frozen=True)
class Registered:
    """An effect of one's own, where it comes from, and a hash of its definition.

    Attributes
    ----------
    effect : Effect
    origin : str or None
        Plugin file or installed package that defines it; None where it was typed in.
    definition : str
    installed : bool
        Whether every process finds it by itself.
    """

    effect: Effect
    origin: str | None
    definition: str
    installed: bool = False


_own: dict[str, Registered] = {}
_asked_packages: list[str] = []
_adopted: set[bytes] = set()


def registered() -> dict[str, Registered]:
    """Return the effects of one's own by name, in the order of their registration."""
    if not _asked_packages:
        _asked_packages.append(GROUP)
        for package, offered in plugins.entry_points(GROUP):
            # a module registers its effects itself, or holds nothing but effects: take both
            found = vars(offered).values() if isinstance(offered, ModuleType) else offered
            effects = found if isinstance(found, Iterable) else (found,)
            for effect in effects:
                if isinstance(effect, Effect) and effect.name not in _own:
                    add(effect, set(), package, installed=True)
    return dict(_own)


def add(
    effect: Effect, built_in: set[str], origin: str | None = None, *, installed: bool = False
) -> Registered:
    """Keep `effect`; see `srs_opt.effects.register_effect`."""
    check(effect, built_in)
    name = effect.name
    entry = Registered(effect, origin or plugins.running() or _source(effect), definition(effect), installed)
    if name in _own and _own[name].definition != entry.definition:
        raise InputError(f"effect '{name}' was registered before with another definition")
    _own.setdefault(name, entry)
    return _own[name]


def check(effect: Effect, built_in: set[str]) -> None:
    """Refuse what cannot be an effect."""
    name = effect.name
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        raise InputError(f"effect '{name}': expected a name of lower-case letters, digits and underscores")
    if name in built_in:
        raise InputError(f"effect '{name}' exists already; choose another name")
    if effect.kind not in KINDS:
        raise InputError(f"effect '{name}': kind must be one of {', '.join(KINDS)}, found '{effect.kind}'")
    kinds = [type(p) for p in effect.parameters]
    if not kinds or kinds[0] in (Component, Direction, Place, Scale, Towards):
        raise InputError(f"effect '{name}': its first parameter must be a size whose zero means absence")
    if effect.size.typical == 0:
        raise InputError(f"effect '{name}': the typical size of '{effect.size.name}' must not be 0")
    if kinds.count(Place) > 1 or kinds.count(Direction) > 1 or kinds.count(Towards) not in (0, 2):
        raise InputError(f"effect '{name}': at most one place, one direction, one point (two coordinates)")
    if not effect.hooks:
        raise InputError(f"effect '{name}' has no hook: it acts on nothing; hooks are {', '.join(HOOKS)}")


def definition(effect: Effect) -> str:
    """Return a hash that changes with the effect's parameters and with the file that defines its hooks."""
    words = f"{effect.name} {effect.kind} {effect.parameters!r} {effect.of_tether}"
    return plugins.digest(_hooks(effect), words)


def _hooks(effect: Effect) -> list[Callable[..., Any]]:
    return [getattr(effect, name) for name in sorted(effect.hooks)]


def _source(effect: Effect) -> str | None:
    """Return the name of the file that defines the effect's hooks, if one does."""
    for hook in _hooks(effect):
        file = getattr(getattr(hook, "__code__", None), "co_filename", "")
        if Path(file).is_file():
            return Path(file).name
    return None


def exported() -> bytes | None:
    """Return the effects that other processes cannot find by themselves, for `adopt`; None: there are none.

    Hooks travel by value, so that a worker, also on another machine, needs no file of the laboratory's.
    """
    own = [r for r in _own.values() if not r.installed]
    if not own:
        return None
    return plugins.dumped(own, [hook for r in own for hook in _hooks(r.effect)])


def adopt(effects: bytes) -> None:
    """Make known what another process exported; what is known already stays."""
    if effects in _adopted:
        return
    import pickle

    for entry in pickle.loads(effects):
        known = _own.setdefault(entry.effect.name, entry)
        if known.definition != entry.definition:
            raise InputError(f"effect '{entry.effect.name}' was registered before with another definition")
    _adopted.add(effects)

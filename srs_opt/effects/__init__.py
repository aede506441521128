"""Effects that a model of this robot can lack: one object each, with everything about it."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from srs_opt.effects.effect import Effect


def all_effects() -> Mapping[str, Effect]:
    """Return every known effect by name, ordered by what it acts on, then by name; own ones last."""
    from srs_opt.effects.plugins import registered

    own = registered()
    return _together(tuple((name, entry.definition) for name, entry in own.items()))


@lru_cache(maxsize=1)
def generic_effects() -> Mapping[str, Effect]:
    """Return the effects that describe what is in no list: the terms of `srs_opt.effects.generic`."""
    from srs_opt.effects.generic import TERMS

    return MappingProxyType({name: term.effect for name, term in TERMS.items()})


def known_effects() -> Mapping[str, Effect]:
    """Return everything that a robot file may name: all effects, then those that only describe."""
    from srs_opt.effects.plugins import registered

    return _all_known(tuple((name, entry.definition) for name, entry in registered().items()))


@lru_cache(maxsize=4)
def _all_known(own: tuple[tuple[str, str], ...]) -> Mapping[str, Effect]:
    return MappingProxyType({**_together(own), **generic_effects()})


@lru_cache(maxsize=4)
def _together(own: tuple[tuple[str, str], ...]) -> Mapping[str, Effect]:
    from srs_opt.effects.plugins import registered

    known = registered()
    return MappingProxyType({**built_in(), **{name: known[name].effect for name, _ in own}})


@lru_cache(maxsize=1)
def built_in() -> Mapping[str, Effect]:
    """Return the effects of the library: every file there defines one, called EFFECT."""
    from srs_opt.effects import library
    from srs_opt.effects.effect import KINDS

    names = [module.name for module in pkgutil.iter_modules(library.__path__)]
    found = [importlib.import_module(f"{library.__name__}.{name}").EFFECT for name in names]
    found.sort(key=lambda e: (KINDS.index(e.kind), e.marker is None, e.name))  # markers come before cameras
    return MappingProxyType({e.name: e for e in found})


def register_effect(effect: Effect) -> Effect:
    """Make an effect of your own known: robot files, models, calibrate and discrepancy then take it.

    Call it in a file that commands are given with ``--plugin``, or in a program; worker processes get it
    from there. A package that is installed offers its effects as entry points of the group
    ``srs_opt.effects`` (an effect, a list of them, or a module).

    Parameters
    ----------
    effect : Effect
        Its first parameter is the size: at zero the effect must vanish.

    Raises
    ------
    InputError
        If the name is taken, is no plain word, the first parameter is not a size, or there is no hook.
    """
    from srs_opt.effects import plugins

    plugins.add(effect, {*built_in(), *generic_effects()})
    return effect


def own_definitions(names: list[str]) -> dict[str, str]:
    """Return a hash of the definition of each registered effect among `names` (none of built-in ones)."""
    from srs_opt.effects.plugins import registered

    return {name: own.definition for name, own in registered().items() if name in names}


def needed_plugins(names: list[str]) -> list[str]:
    """Return the plugins that define the effects among `names` (none for built-in ones), in order."""
    from srs_opt.effects.plugins import registered

    origins = [own.origin for name, own in registered().items() if name in names]
    return list(dict.fromkeys(origin for origin in origins if origin))


def known_plugins() -> set[str]:
    """Return the plugins that may be needed and are there: run, installed, or in the running program."""
    from srs_opt.effects.plugins import registered
    from srs_opt.plugins import loaded

    return {*loaded(), *(own.origin for own in registered().values() if own.origin)}

"""Effects that a model of this robot can lack: a file per family, an entry per effect."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from srs_opt.document import Document, Place, unknown_word

if TYPE_CHECKING:
    from srs_opt.model.effects.effect import Effect, EffectParameter


_LARGEST = 1e6  # no effect's parameter is that large in SI units; beyond lie slips of the keyboard


@lru_cache(maxsize=1)
def all_effects() -> Mapping[str, Effect]:
    """Return every known effect by name, in a fixed order; registered ones come last."""
    from srs_opt.model.effects.own import own_effects

    return MappingProxyType({**_built_in(), **own_effects()})


@lru_cache(maxsize=1)
def _built_in() -> Mapping[str, Effect]:
    from srs_opt.model.effects import actuation, body, ground, measurement, room, tether

    families = (tether, room, body, ground, actuation, measurement)
    return MappingProxyType({e.name: e for family in families for e in family.EFFECTS})


def register_effect(effect: Effect) -> Effect:
    """Make an effect of your own known: robot files, models, calibrate and discrepancy then take it.

    Call it at the top of a file and name that file in the environment variable SRS_OPT_EFFECTS
    (several as in PATH); commands and their worker processes load it.

    Parameters
    ----------
    effect : Effect
        Its first parameter is the size: at zero the effect must vanish.

    Raises
    ------
    InputError
        If the name is taken, is no plain word, or the first parameter is not a size.
    """
    from srs_opt.model.effects import own

    own.add(effect, set(_built_in()))
    all_effects.cache_clear()
    return effect


def own_definitions(names: list[str]) -> dict[str, str]:
    """Return a hash of the definition of each registered effect among `names` (none of built-in ones)."""
    from srs_opt.model.effects import own

    return {name: own.definition(effect) for name, effect in own.own_effects().items() if name in names}


def check_effects(
    document: Document, entries: list[dict[str, Any]], links: int
) -> tuple[Mapping[str, Any], ...]:
    """Validate the ``effects:`` list of a robot file and fill in typical places and scales.

    Raises
    ------
    InputError
        For an unknown effect or parameter, a missing size, a value outside its physical bounds, a repeat.
    """
    checked: list[Mapping[str, Any]] = []
    seen: set[tuple[Any, ...]] = set()
    for index, entry in enumerate(entries):
        values = check_effect(document, index, entry, links)
        places = [p.name for p in all_effects()[entry["name"]].parameters if p.place]
        identity = (entry["name"], *(values[name] for name in places))
        if identity in seen:
            raise document.error(("effects", index), f"effect '{entry['name']}' is listed twice")
        seen.add(identity)
        checked.append(values)
    return tuple(checked)


def check_effect(document: Document, index: int, entry: dict[str, Any], links: int) -> Mapping[str, Any]:
    """Validate one entry of the list as `check_effects` does, whatever the others say."""
    place: Place = ("effects", index)
    effect = all_effects().get(entry["name"])
    if effect is None:
        raise document.error((*place, "name"), unknown_word("effect", entry["name"], sorted(all_effects())))
    known = {p.name: p for p in effect.parameters}
    for key in entry:
        if key != "name" and key not in known:
            raise document.error((*place, key), unknown_word("key", str(key), ["name", *known]))
    if effect.size.name not in entry:
        raise document.error(place, f"effect '{effect.name}' needs '{effect.size.name}' ({effect.size.unit})")
    values: dict[str, Any] = {"name": effect.name}
    for parameter in effect.parameters:
        value = entry.get(parameter.name, _default(parameter))
        _check_value(document, (*place, parameter.name), parameter, value, links)
        values[parameter.name] = int(value) if parameter.place else float(value)
    return MappingProxyType(values)


def _default(parameter: EffectParameter) -> float:
    """Second parameters default to their typical value, except offsets, which default to zero."""
    return 0.0 if parameter.name == "dy_m" else parameter.typical


def _check_value(
    document: Document, place: Place, parameter: EffectParameter, value: Any, links: int
) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise document.error(place, f"expected a number{f' in {parameter.unit}' if parameter.unit else ''}")
    if abs(value) > _LARGEST:
        raise document.error(place, f"must lie between -{_LARGEST:g} and {_LARGEST:g}")
    if parameter.place:
        last = links if parameter.place == "link" else links - 1
        if value != int(value) or not 1 <= value <= last:
            raise document.error(
                place, f"expected a {parameter.place} number from 1 (tail) to {last}, found {value}"
            )
    elif value < parameter.lower or (parameter.exclusive and value == parameter.lower):
        relation = "greater than" if parameter.exclusive else "at least"
        raise document.error(place, f"must be {relation} {parameter.lower:g}, found {value:g}")

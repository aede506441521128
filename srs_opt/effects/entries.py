"""The ``effects:`` list of a robot file: what an entry may hold, and what it leaves of the body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from srs_opt.document import Document, Place, unknown_word
from srs_opt.effects import known_effects, known_plugins
from srs_opt.effects.effect import Effect
from srs_opt.effects.parameter import EffectParameter
from srs_opt.effects.parameter import Place as PlaceParameter

_LARGEST = 1e6  # no effect's parameter is that large in SI units; beyond lie slips of the keyboard
SD = "sd"  # key of an entry: parameter -> standard deviation


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
        place = known_effects()[entry["name"]].place
        identity = (entry["name"], values[place.name] if place else None)
        if identity in seen:
            raise document.error(("effects", index), f"effect '{entry['name']}' is listed twice")
        seen.add(identity)
        checked.append(values)
    return tuple(checked)


def check_effect(document: Document, index: int, entry: dict[str, Any], links: int) -> Mapping[str, Any]:
    """Validate one entry of the list as `check_effects` does, whatever the others say."""
    place: Place = ("effects", index)
    effect = known_effects().get(entry["name"])
    if effect is None:
        raise document.error((*place, "name"), unknown_word("effect", entry["name"], sorted(known_effects())))
    known = {p.name: p for p in effect.parameters}
    for key in entry:
        if key not in ("name", SD) and key not in known:
            raise document.error((*place, key), unknown_word("key", str(key), ["name", *known, SD]))
    if effect.size.name not in entry:
        raise document.error(place, f"effect '{effect.name}' needs '{effect.size.name}' ({effect.size.unit})")
    values: dict[str, Any] = {"name": effect.name}
    for parameter in effect.parameters:
        value = entry.get(parameter.name, parameter.default)
        _check_value(document, (*place, parameter.name), parameter, value, links)
        values[parameter.name] = int(value) if isinstance(parameter, PlaceParameter) else float(value)
    if SD in entry:
        values[SD] = _checked_sd(document, (*place, SD), effect, entry[SD])
    return MappingProxyType(values)


def _checked_sd(document: Document, place: Place, effect: Effect, given: Any) -> dict[str, float]:
    """Return the deviations of an entry: positive numbers for parameters that are no place."""
    known = [p.name for p in effect.parameters if not isinstance(p, PlaceParameter)]
    if not isinstance(given, Mapping):
        raise document.error(place, f"expected a mapping like {{{known[0]}: 0.1}}")
    for key, value in given.items():
        if key not in known:
            raise document.error((*place, key), unknown_word("parameter", str(key), known))
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value <= _LARGEST:
            raise document.error((*place, key), "expected a standard deviation above 0")
    return {str(key): float(value) for key, value in given.items()}


def _check_value(
    document: Document, place: Place, parameter: EffectParameter, value: Any, links: int
) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise document.error(place, f"expected a number{f' in {parameter.unit}' if parameter.unit else ''}")
    if abs(value) > _LARGEST:
        raise document.error(place, f"must lie between -{_LARGEST:g} and {_LARGEST:g}")
    if isinstance(parameter, PlaceParameter):
        last = parameter.count(links)
        if value != int(value) or not 1 <= value <= last:
            raise document.error(
                place, f"expected a {parameter.of} number from 1 (tail) to {last}, found {value}"
            )
    elif value < parameter.lower or (parameter.exclusive and value == parameter.lower):
        relation = "greater than" if parameter.exclusive else "at least"
        raise document.error(place, f"must be {relation} {parameter.lower:g}, found {value:g}")
    elif value > parameter.upper:
        raise document.error(place, f"must be at most {parameter.upper:g}, found {value:g}")


def spread_over_places(effect: Effect, entry: Mapping[str, Any], links: int) -> dict[str, Any]:
    """Return an entry's parameters as hooks get them: over all places, zero where it does not act."""
    if effect.place is None:
        return {p.name: float(entry[p.name]) for p in effect.parameters}
    import casadi as ca

    place, found = effect.place, {}
    for p in effect.parameters:
        if p is not place:
            vector = ca.DM.ones(place.count(links), 1) * (p.default if p is not effect.size else 0.0)
            vector[int(entry[place.name]) - 1] = float(entry[p.name])
            found[p.name] = vector
    return found


def check_body(
    document: Document, entries: Sequence[Mapping[str, Any]], links: int, link_mass_kg: float, gap_m: float
) -> None:
    """Refuse effects that leave a link without mass or a gap without length.

    Raises
    ------
    InputError
        Naming the entry that goes too far.
    """
    import casadi as ca

    mass, gap = ca.SX.ones(links, 1) * link_mass_kg, ca.SX(gap_m)
    for index, entry in enumerate(entries):
        effect = known_effects()[entry["name"]]
        if not effect.extra_mass and not effect.gap_extra:
            continue
        e, where = spread_over_places(effect, entry, links), ("effects", index, effect.size.name)
        if effect.extra_mass:
            mass = mass + effect.extra_mass(e, links)
            lightest = min(float(m) for m in ca.vertsplit(ca.evalf(mass)))
            if lightest <= 0:
                raise document.error(where, f"leaves a link {lightest:g} kg; its mass must stay above 0")
        if effect.gap_extra:
            gap = gap + effect.gap_extra(e)
            shortest = min(float(g) for g in ca.vertsplit(ca.evalf(gap)))
            if shortest < 0:
                raise document.error(where, f"leaves gaps of {shortest:g} m; they must stay at least 0")


def check_plugins(document: Document, names: list[str]) -> None:
    """Refuse a robot file that needs a plugin which is not there.

    Raises
    ------
    InputError
        Saying what to add to the command line.
    """
    missing = [name for name in names if name not in known_plugins()]
    if missing:
        raise document.error(
            ("plugins", names.index(missing[0])),
            f"needs the plugin '{missing[0]}', which defines effects of its own: name it with "
            f"--plugin {missing[0]} (the file is run), or install the package of that name",
        )

"""Read the robot file of somebody's own robot: what the laboratory then has on its floor."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from virtual_lab.catalogue import check_effect, find_kind
from virtual_lab.errors import LabError
from virtual_lab.truth import DOCUMENTED, Parameters

# keys of a robot file that say nothing about motion here: friction is finer in the laboratory
_OTHER = ("name", "body_width_m", "friction_speed_m_s", "sources")
_TABLES = ("effects", "relative_sd")


@dataclass(frozen=True)
class RobotFile:
    """A robot as documented.

    Attributes
    ----------
    parameters : Parameters
    relative_sd : mapping
        How well the file claims to know each value.
    effects : tuple of mapping
        Effects that the file names; they are at work, and no secret.
    other : mapping
        What else the file says.
    """

    parameters: Parameters = DOCUMENTED
    relative_sd: Mapping[str, float] = field(default_factory=dict)
    effects: tuple[Mapping[str, Any], ...] = ()
    other: Mapping[str, Any] = field(default_factory=lambda: {"name": "WPI SRS"})


WPI_SRS = RobotFile()


def read_robot(path: Path) -> RobotFile:
    """Read a robot file.

    Raises
    ------
    LabError
        It cannot be read, or holds what is no key of a robot file or no number.
    """
    try:
        record = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise LabError(f"{path}: cannot be read ({error.strerror})") from None
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        raise LabError(f"{path}: is no robot file ({' '.join(str(error).split())})") from None
    if not isinstance(record, dict):
        raise LabError(f"{path}: is no robot file; expected keys like link_mass_kg: 0.03")
    fields = {f.name for f in dataclasses.fields(Parameters)}
    for key in record:
        if key not in (*fields, *_OTHER, *_TABLES):
            raise LabError(f"{path}: '{key}' is nothing that the laboratory can build")
    try:
        parameters = Parameters(**{k: _value(k, v) for k, v in record.items() if k in fields})
        sds = {str(k): _number(f"relative_sd {k}", v) for k, v in _table(record, "relative_sd", dict).items()}
        effects = tuple(_effect(e, parameters.links) for e in _table(record, "effects", list))
    except LabError as error:
        raise LabError(f"{path}: {error}") from None
    for key in sds:
        if key not in fields or not isinstance(getattr(parameters, key), float):
            raise LabError(f"{path}: relative_sd names '{key}', which the file gives no value")
    return RobotFile(parameters, sds, effects, {k: record[k] for k in _OTHER if k in record})


def _table(record: Mapping[str, Any], key: str, kind: type) -> Any:
    found = record.get(key) or kind()
    if not isinstance(found, kind):
        raise LabError(f"{key}: expected a {'mapping' if kind is dict else 'list'}")
    return found


def _value(key: str, value: Any) -> Any:
    if key == "friction_law":
        return str(value)
    number = _number(key, value)
    if key == "links":
        if number != int(number):
            raise LabError(f"links: expected a whole number, found {number:g}")
        return int(number)
    return number


def _number(key: str, value: Any) -> float:
    if isinstance(value, str):  # YAML 1.1 reads 1e9 as a word
        with contextlib.suppress(ValueError):
            value = float(value)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value < math.inf:
        raise LabError(f"{key}: expected a number not below 0, found {value!r}")
    return float(value)


def _effect(entry: Any, links: int) -> dict[str, Any]:
    if not isinstance(entry, dict):
        raise LabError("effects: expected entries like {name: tether_drag, force_n: 0.03}")
    bare = {k: v for k, v in entry.items() if k != "sd"}
    if not find_kind(str(bare.get("name"))).listed:
        raise LabError(f"effects: models know no '{bare['name']}'; hide it with --effect")
    return {"name": bare.get("name"), **check_effect(bare, links)}

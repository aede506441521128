"""The robot: a frozen, validated description read from YAML.

The built-in robot is the WPI SRS of the paper; its file marks every value as
published (Table 2) or assumed.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any

from srs_opt.document import Document, load_schema, parse_yaml, read_yaml, validate, violations
from srs_opt.errors import InputError

EffectSpec = Mapping[str, Any]
MIN_LINKS, MAX_LINKS = 3, 64
RELAXATION_S = 0.005  # of silicone, where the robot file says nothing


@dataclass(frozen=True)
class Robot:
    """A pneumatic soft snake; every field is a key of the robot file.

    Attributes
    ----------
    links : int
        Wheel pairs N, numbered tail (1) to head (N); there are N-1 bending segments.
    segment_length_m, gap_length_m : float
        Pressure chamber l and unactuated gap L_o; the pitch is l + L_o (paper, Fig. 11).
    link_mass_kg, link_inertia_kg_m2 : float
        Mass m and own inertia J of each link (Table 1).
    friction_law : {"per_axis", "cone"}
        Coulomb friction per wheel axis, or on the friction cone (Hu and Shelley).
    friction_tangential, friction_normal : float
        mu_t along and mu_n across the wheels (Table 2).
    friction_speed_m_s : float
        Smoothing speed v_s of the sign function; numerical, not physical.
    curvature_per_pressure_1_m_kpa : float
        C0 over pressure in the step response (14).
    tau1_s, tau2_s : float
        Time constants of (14).
    bending_stiffness_n_m2, gap_stiffness_n_m2 : float or None
        EI of a segment's chamber and of the gap between two; None: rigid (it follows the actuators whatever
        the load).
    bending_relaxation_s : float or None
        Relaxation time of the material (0.005 s where a stiffness is given).
    effects : tuple of dict
        Effects beyond the paper's model, ``{"name": ..., parameter: value, ..., "sd": {parameter: value}}``;
        calibration refits what has a deviation.
    plugins : tuple of str
        What defines effects of one's own among them: plugin files or installed packages.
    relative_sd : dict
        Standard deviation over value, per parameter.
    sources : dict
        Parameter -> published, assumed, bench or calibrated.
    """

    name: str = "unnamed"
    links: int = 5
    segment_length_m: float = 0.037
    gap_length_m: float = 0.012
    link_mass_kg: float = 0.030
    link_inertia_kg_m2: float = 1e-6
    body_width_m: float = 0.040
    friction_law: str = "per_axis"
    friction_tangential: float = 0.043
    friction_normal: float = 0.57
    friction_speed_m_s: float = 0.002
    gravity_m_s2: float = 9.81
    curvature_per_pressure_1_m_kpa: float = 0.35
    tau1_s: float = 0.08
    tau2_s: float = 0.05
    valve_delay_s: float = 0.0
    bending_stiffness_n_m2: float | None = None
    bending_relaxation_s: float | None = None
    gap_stiffness_n_m2: float | None = None
    effects: tuple[EffectSpec, ...] = ()
    plugins: tuple[str, ...] = ()
    relative_sd: Mapping[str, float] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)

    @property
    def segments(self) -> int:
        """Number of bending segments, N - 1."""
        return self.links - 1

    @property
    def pitch_m(self) -> float:
        """Distance between neighbouring links of the straight robot, l + L_o."""
        return self.segment_length_m + self.gap_length_m

    @property
    def length_m(self) -> float:
        """Length of the straight robot from the first wheel pair to the last, plus the body's round ends."""
        return self.segments * self.pitch_m + self.body_width_m

    @property
    def max_curvature_1_m(self) -> float:
        """Curvature at which a segment has bent by 2 pi and would meet itself."""
        return 2 * math.pi / self.segment_length_m

    @property
    def is_soft(self) -> bool:
        """Whether the body bends under load, by its own stiffness or an effect's."""
        return self.has_stiffness or bool(self.effects and _bending(self.effects))

    @property
    def has_stiffness(self) -> bool:
        """Whether the robot file gives the segments or the gaps a stiffness."""
        return self.bending_stiffness_n_m2 is not None or self.gap_stiffness_n_m2 is not None

    @property
    def own_model(self) -> str:
        """Name of the dynamic model that takes all that the robot file says."""
        return "compliant" if self.is_soft else "complex"

    def with_values(self, **changes: Any) -> Robot:
        """Return a validated copy with some fields changed; None takes a stiffness away."""
        record = {k: v for k, v in {**self.to_record(), **changes}.items() if v is not None}
        return robot_from_document(Document(f"robot '{self.name}'", _plain(record)))

    def to_record(self) -> dict[str, Any]:
        """Return the robot as the mapping that a robot file holds."""
        record = {f.name: _plain(getattr(self, f.name)) for f in dataclasses.fields(self)}
        return {key: value for key, value in record.items() if value is not None}

    def fingerprint(self) -> str:
        """Return a hash of everything that bears on motion (not name, sources or deviations)."""
        record = self.to_record()
        for key in ("name", "sources", "relative_sd", "plugins"):
            del record[key]
        record["effects"] = [{k: v for k, v in e.items() if k != "sd"} for e in record["effects"]]
        # a relaxation time means nothing in a rigid body
        if not self.is_soft:
            record.pop("bending_relaxation_s", None)
        if self.effects:
            from srs_opt.effects import own_definitions

            definitions = own_definitions([str(spec["name"]) for spec in self.effects])
            record |= {f"definition of {name}": digest for name, digest in definitions.items()}
        text = json.dumps(record, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def __reduce__(self) -> tuple[Any, ...]:  # read-only effects do not pickle; worker processes need robots
        from srs_opt.effects import plugins

        return _restored, (self.to_record(), plugins.exported())

    def __hash__(self) -> int:
        # the mappings in it cannot be hashed themselves
        return hash(json.dumps(self.to_record(), sort_keys=True))


def _bending(effects: tuple[EffectSpec, ...]) -> bool:
    from srs_opt.effects import known_effects

    known = known_effects()
    return any(known[e["name"]].bends and e[known[e["name"]].size.name] != 0 for e in effects)


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(v) for v in value]
    if hasattr(value, "item"):  # numpy scalars
        return value.item()
    return value


def _restored(record: dict[str, Any], own_effects: bytes | None = None) -> Robot:
    """Rebuild a robot that another process sent, with the effects of one's own that are known there."""
    if own_effects is not None:
        from srs_opt.effects import plugins

        plugins.adopt(own_effects)
    record["plugins"] = tuple(record["plugins"])
    record["effects"] = tuple(MappingProxyType(spec) for spec in record["effects"])
    return Robot(**record)


def robot_from_document(document: Document) -> Robot:
    """Validate a parsed robot file and return the robot.

    Raises
    ------
    InputError
        Naming the file, the line and the key, for unknown keys, wrong types and impossible values.
    """
    validate(document, load_schema("srs_opt.robots", "robot.schema.json"))
    record = dict(document.value)
    misplaced = _misplaced(document)
    if misplaced:
        raise misplaced[0]
    if record.get("plugins"):
        from srs_opt.effects.entries import check_plugins

        check_plugins(document, record["plugins"])
    record["plugins"] = tuple(record.get("plugins", ()))
    if "effects" in record:
        from srs_opt.effects.entries import check_effects

        record["effects"] = check_effects(document, record["effects"], int(record.get("links", 5)))
    for key, value in record.items():
        if isinstance(value, (int, float)):
            record[key] = int(value) if key == "links" else float(value)
    robot = Robot(**record)
    if robot.has_stiffness and robot.bending_relaxation_s is None:
        robot = dataclasses.replace(robot, bending_relaxation_s=RELAXATION_S)
    if robot.effects:
        from srs_opt.effects.entries import check_body

        check_body(document, robot.effects, robot.links, robot.link_mass_kg, robot.gap_length_m)
    return robot


def robot_problems(document: Document) -> list[InputError]:
    """Return everything that is wrong with a parsed robot file, where `robot_from_document` stops at one."""
    found = violations(document, load_schema("srs_opt.robots", "robot.schema.json"))
    found += _misplaced(document)
    if isinstance(document.value, dict):
        found += _effect_problems(document, document.value.get("effects"), document.value.get("links", 5))
    if not found:
        try:
            robot_from_document(document)
        except InputError as error:
            found.append(error)
    return found


def _misplaced(document: Document) -> list[InputError]:
    """Return what the tables about parameters say of things that are none."""
    parameters = {f.name for f in dataclasses.fields(Robot)} - {
        "name",
        "effects",
        "plugins",
        "relative_sd",
        "sources",
    }
    record = document.value if isinstance(document.value, dict) else {}
    tables = {name: record.get(name) for name in ("relative_sd", "sources")}
    return [
        document.error((name, key), "is not a parameter of the robot")
        for name, table in tables.items()
        if isinstance(table, dict)
        for key in table
        if key not in parameters
    ]


def _effect_problems(document: Document, entries: Any, links: Any) -> list[InputError]:
    """Return what is wrong with the single effects; entries without a name are the schema's business."""
    from srs_opt.effects.entries import check_effect

    found = []
    for index, entry in enumerate(entries if isinstance(entries, list) else ()):
        if isinstance(entry, dict) and isinstance(entry.get("name"), str):
            try:
                check_effect(document, index, entry, links if isinstance(links, int) else MAX_LINKS)
            except InputError as error:
                found.append(error)
    return found


def load_robot(path: Path | str | None = None) -> Robot:
    """Read a robot file; without one, return the built-in WPI SRS.

    Raises
    ------
    InputError
        If the file is not a valid robot file.
    """
    if path is None:
        return wpi_srs()
    return robot_from_document(read_yaml(path, "a robot file (YAML)", lenient=True))


@lru_cache(maxsize=1)
def wpi_srs() -> Robot:
    """Return the paper's robot; see its file for which values are published and which assumed."""
    text = resources.files("srs_opt.robots").joinpath("wpi_srs.yaml").read_text(encoding="utf-8")
    return robot_from_document(parse_yaml(text, "srs_opt/robots/wpi_srs.yaml", "a robot file"))


def save_robot(robot: Robot, path: Path | str, header: str = "") -> Path:
    """Write `robot` as a robot file (atomically); lists and tables in readable YAML, below a comment."""
    import yaml

    from srs_opt.effects import needed_plugins
    from srs_opt.files import write_text

    record = robot.to_record()
    needed = needed_plugins([str(spec["name"]) for spec in robot.effects])
    record["plugins"] = list(dict.fromkeys([*record["plugins"], *needed]))
    for key in ("plugins", "relative_sd", "sources"):
        if not record[key]:
            del record[key]
    text = yaml.safe_dump(record, sort_keys=False, width=100)
    return write_text(path, f"{header}\n{text}" if header else text)


__all__ = [
    "InputError",
    "Robot",
    "load_robot",
    "robot_from_document",
    "robot_problems",
    "save_robot",
    "wpi_srs",
]

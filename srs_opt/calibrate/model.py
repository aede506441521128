"""The compiled model with every effect built in, absent where its size is zero, and its packed parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from srs_opt.calibrate.coordinates import FRICTION_SPEED, Candidate, Coordinate
from srs_opt.model.effects import all_effects
from srs_opt.model.parameters import ROBOT_PARAMETERS, Structure
from srs_opt.model.registry import build
from srs_opt.robot import Robot

_TETHER = ("tether_drag", "tether_viscous", "tether_pull", "tether_weight")
# a pull and a slope stand twice, once per axis of the room
_MECHANICAL = (
    "tether_drag",
    "tether_viscous",
    "tether_weight",
    "tether_pull",
    "tether_pull",
    "floor_slope",
    "floor_slope",
    "gap_bending",
    "head_mass",
    "single_wheel_toe",
    "segment_bias",
    "viscous_rolling",
    "stribeck",
    "slip_rate",
)
_NONLINEAR = ("fill_exhaust_asymmetry", "curvature_stiffening", "hysteresis")
FULL = _MECHANICAL + _NONLINEAR
CAMERA = ("marker_offset.dx_m", "marker_offset.dy_m", "camera_scale.scale", "camera_tilt.per_m")
CLOCK = ("dead_time.delay_s", "clock_offset.offset_s")
# coordinates that scale C0 and so need no place in the compiled model
_GAIN = ("bending_resistance.ratio", "supply_droop.per_hz")

Values = Mapping[str, float]


@dataclass(frozen=True)
class Conditions:
    """What of a trial enters the equations."""

    pressure_kpa: float
    frequency_hz: float
    tether: bool = True


class Model:
    """One robot's equations in the fit's coordinates.

    Parameters
    ----------
    robot : Robot
        Bench values; effects that the robot file already names are part of the starting point.
    model : {"complex", "simplified"}
    """

    def __init__(self, robot: Robot, model: str = "complex") -> None:
        self.robot = robot
        links, law = robot.links, robot.friction_law
        self.structures = tuple(Structure(model, links, law, e) for e in ((), _MECHANICAL, FULL))
        self.full = self.structures[-1]
        self.links, self.segments = links, links - 1
        self.names = _layout(self.full)
        self._index = {name: i for i, name in enumerate(self.names)}
        self._starts = tuple(
            np.array([self._index[n] for n in _layout(structure)]) for structure in self.structures
        )

    def structure(
        self, values: Values, coordinates: Sequence[Coordinate] = ()
    ) -> tuple[Structure, np.ndarray]:
        """Return the smallest structure with the effects of `values`, and where its parameters are.

        Effects that only `coordinates` name, for derivatives at zero, are in it too.
        """
        present = {name.split(".")[0] for name, v in values.items() if "." in name and v != 0}
        present |= {c.effect for c in coordinates}
        present |= {"single_wheel_toe"} if "wheel_toe" in present else set()
        present |= {"segment_bias"} if "curvature_bias" in present else set()
        level = 2 if present & set(_NONLINEAR) else 1 if present & set(_MECHANICAL) else 0
        return self.structures[level], self._starts[level]

    def pack(self, values: Values, conditions: Conditions) -> np.ndarray:
        """Return the full structure's parameter vector at `values`."""
        p = np.zeros(len(self.names))
        for name in ROBOT_PARAMETERS:
            p[self._index[name]] = getattr(self.robot, name) * math.exp(values.get(name, 0.0))
        p[self._index["pressure_kpa"]] = conditions.pressure_kpa
        p[self._index["frequency_hz"]] = conditions.frequency_hz
        p[self._index["gap_length_m"]] += values.get("gap_length.extra_m", 0.0)
        p[self._index["curvature_per_pressure_1_m_kpa"]] *= self._gain(values, conditions)
        self._set_places(p, values)
        self._set_scales(p, values)
        for name, value in values.items():
            if name in self._plain and (conditions.tether or name.split(".")[0] not in _TETHER):
                p[self._plain[name]] = value
        self._set_room(p, values, conditions)
        return p

    def seeds(self, values: Values, conditions: Conditions, coordinates: Sequence[Coordinate]) -> np.ndarray:
        """Return the derivative of `pack` by `coordinates`, shape (parameters, coordinates)."""
        p = self.pack(values, conditions)
        out = np.zeros((p.size, len(coordinates)))
        for k, coordinate in enumerate(coordinates):
            for index, slope in self._slopes(coordinate.name, p, values, conditions):
                out[index, k] = slope
        return out

    @property
    def _plain(self) -> dict[str, int]:
        """Coordinates that are entries of the packed vector themselves."""
        return _plain_entries(self.full)

    def _gain(self, values: Values, conditions: Conditions) -> float:
        gain = 1.0
        for name in _GAIN:
            effect, part = name.split(".")
            hook = all_effects()[effect].gain
            assert hook is not None
            gain *= float(hook({part: values.get(name, 0.0)}, conditions.frequency_hz))  # type: ignore[dict-item, arg-type]
        return gain

    def _set_places(self, p: np.ndarray, values: Values) -> None:
        for effect, size, common, count in self._placed():
            p[self._at(effect, size)] = 1.0
            shared = values.get(common, 0.0)
            for k in range(1, count + 1):
                own = values.get(f"{effect}.{size}[{k}]", 0.0)
                p[self._at(effect, _place_key(effect), k)] = shared + own

    def _placed(self) -> tuple[tuple[str, str, str, int], ...]:
        return (
            ("segment_bias", "bias", "curvature_bias.bias", self.segments),
            ("single_wheel_toe", "angle", "wheel_toe.angle", self.links),
        )

    def _set_scales(self, p: np.ndarray, values: Values) -> None:
        p[self._at("hysteresis", "width")] = math.exp(values.get("hysteresis.log_width", math.log(4.0)))
        p[self._at("stribeck", "speed")] = math.exp(values.get("stribeck.log_speed", math.log(0.08)))

    def _set_room(self, p: np.ndarray, values: Values, conditions: Conditions) -> None:
        p[self._at("floor_slope", "angle", copy=0)] = values.get("floor_slope.x", 0.0)
        p[self._at("floor_slope", "angle", copy=1)] = values.get("floor_slope.y", 0.0)
        p[self._at("floor_slope", "direction", copy=1)] = math.pi / 2
        force, x, y, away = _pull(values)
        for copy, (f, ax, ay) in enumerate(((force, x, y), (0.0, 0.0, 1.0))):
            p[self._at("tether_pull", "force_n", copy=copy)] = f if conditions.tether else 0.0
            p[self._at("tether_pull", "ax_m", copy=copy)] = ax * away
            p[self._at("tether_pull", "ay_m", copy=copy)] = ay * away

    def _slopes(
        self, name: str, p: np.ndarray, values: Values, conditions: Conditions
    ) -> list[tuple[int, float]]:
        """Return the entries of the packed vector that a coordinate moves, and how fast."""
        effect = name.split(".")[0]
        c0 = self._index["curvature_per_pressure_1_m_kpa"]
        if name in self._index and "." not in name:
            own = p[self._index[name]]
            if name == "gap_length_m":
                own -= values.get("gap_length.extra_m", 0.0)
            return [(self._index[name], own)]
        if effect in _TETHER and not conditions.tether:
            return []
        if name == "gap_length.extra_m":
            return [(self._index["gap_length_m"], 1.0)]
        if name == "bending_resistance.ratio":
            return [(c0, -p[c0] / (1 + values.get(name, 0.0)))]
        if name == "supply_droop.per_hz":
            f = conditions.frequency_hz
            return [(c0, -f * p[c0] / (1 - values.get(name, 0.0) * f))]
        for placed, size, common, count in self._placed():
            if name == common:
                return [(self._at(placed, _place_key(placed), k), 1.0) for k in range(1, count + 1)]
            if name.startswith(f"{placed}.{size}["):
                return [(self._at(placed, _place_key(placed), int(name.split("[")[1][:-1])), 1.0)]
        if name in ("hysteresis.log_width", "stribeck.log_speed"):
            index = self._at(effect, name.split("log_")[1])
            return [(index, p[index])]
        if effect == "floor_slope":
            return [(self._at(effect, "angle", copy=0 if name.endswith("x") else 1), 1.0)]
        if effect == "tether_pull":
            return self._pull_slopes(name, values)
        return [(self._plain[name], 1.0)] if name in self._plain else []

    def _pull_slopes(self, name: str, values: Values) -> list[tuple[int, float]]:
        force, x, y, away = _pull(values)
        ax, ay, size = (self._at("tether_pull", key, copy=0) for key in ("ax_m", "ay_m", "force_n"))
        if name.endswith("nearness"):
            return [(ax, -x * away), (ay, -y * away)]
        if force == 0:
            return [(self._at("tether_pull", "force_n", copy=0 if name.endswith("x_n") else 1), 1.0)]
        if name.endswith("x_n"):
            return [(size, x), (ax, away * y * y / force), (ay, -away * x * y / force)]
        return [(size, y), (ax, -away * x * y / force), (ay, away * x * x / force)]

    def _at(self, effect: str, parameter: str, place: int | None = None, copy: int = 0) -> int:
        first = self.full.effects.index(effect) + copy
        key = f"{first}.{effect}.{parameter}"
        return self._index[key if place is None else f"{key}[{place}]"]


def _pull(values: Values) -> tuple[float, float, float, float]:
    """Return force, unit direction and distance of the tether's anchor (east while there is no force)."""
    fx, fy = values.get("tether_pull.x_n", 0.0), values.get("tether_pull.y_n", 0.0)
    away = math.exp(-values.get("tether_pull.log_nearness", math.log(0.8)))
    force = math.hypot(fx, fy)
    return (force, fx / force, fy / force, away) if force > 0 else (0.0, 1.0, 0.0, away)


def _place_key(effect: str) -> str:
    return "link" if effect == "single_wheel_toe" else "segment"


def _layout(structure: Structure) -> tuple[str, ...]:
    """Return the packed names with effects numbered as in the full structure."""
    names = []
    for name in build(structure)[0].names:
        head, _, rest = name.partition(".")
        if rest and structure.effects != FULL:
            effect = rest.split(".")[0]
            copy = int(head) - structure.effects.index(effect)
            name = f"{FULL.index(effect) + copy}.{rest}"
        names.append(name)
    return tuple(names)


@lru_cache(maxsize=16)
def _plain_entries(structure: Structure) -> dict[str, int]:
    skip = ("segment_bias", "single_wheel_toe", "floor_slope", "tether_pull")
    entries = {}
    for index, name in enumerate(_layout(structure)):
        if "." in name:
            _, effect, part = name.split(".")
            if effect not in skip and part not in ("width", "speed"):
                entries[f"{effect}.{part}"] = index
    return entries


def candidate_names(candidates: Sequence[Candidate]) -> tuple[str, ...]:
    """Return the candidates' labels."""
    return tuple(c.label for c in candidates)


__all__ = ["CAMERA", "CLOCK", "FRICTION_SPEED", "Conditions", "Model", "Values", "candidate_names"]

"""The coordinates that a fit moves in: logs of the robot's parameters, and the effects' sizes.

Every effect enters through coordinates in which it is absent at zero and smooth around it: a bias or a toe
gets one coordinate per place, a slope or a pull its two components, so that one linearisation without any
effect sees all effects at all places.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from srs_opt.robot import Robot

INFINITY = math.inf
FRICTION_SPEED = "friction_speed_m_s"
FRICTION_SPEED_RANGE_M_S = (0.0003, 0.003)
# standard deviations assumed for what the robot file gives none (relative)
ASSUMED_SD = {
    "friction_tangential": 0.10,
    "friction_normal": 0.10,
    "curvature_per_pressure_1_m_kpa": 0.05,
    "tau1_s": 0.10,
    "tau2_s": 0.10,
}
SCATTER_SD = {
    "friction_tangential": 0.03,
    "friction_normal": 0.03,
    "curvature_per_pressure_1_m_kpa": 0.01,
}


@dataclass(frozen=True)
class Coordinate:
    """One direction of a fit.

    Attributes
    ----------
    name : str
        A robot parameter (its log over the bench value), or ``effect.part``.
    effect : str
        The effect that it belongs to; empty for robot parameters.
    typical : float
        Size at which the effect begins to matter (1 for logs).
    lower : float
        Physical bound.
    prior_sd : float
        Standard deviation about `start` (infinite: free).
    start : float
        Value before any fit; for scales (width, speed, nearness) the typical log.
    """

    name: str
    effect: str = ""
    typical: float = 1.0
    lower: float = -INFINITY
    prior_sd: float = INFINITY
    start: float = 0.0


def base_coordinates(robot: Robot) -> tuple[Coordinate, ...]:
    """Return the calibrated robot parameters: those with a bench deviation, and the nuisance v_s."""
    sds = {**ASSUMED_SD, **robot.relative_sd}
    names = [n for n, sd in sds.items() if sd > 0 and n in _CALIBRATED and getattr(robot, n) > 0]
    chosen = [Coordinate(name, prior_sd=sds[name]) for name in _CALIBRATED if name in names]
    low, high = (math.log(v / robot.friction_speed_m_s) for v in FRICTION_SPEED_RANGE_M_S)
    speed = Coordinate(FRICTION_SPEED, prior_sd=(high - low) / 2, start=(high + low) / 2, lower=low - 0.2)
    return (*chosen, speed)


_CALIBRATED = (*ASSUMED_SD, "segment_length_m", "gap_length_m", "link_mass_kg", "link_inertia_kg_m2")

_WIDTH_SD = 0.7  # of logs of scales about their typical values


def _sizes(effect: str, part: str, typical: float, lower: float = -INFINITY) -> Coordinate:
    return Coordinate(f"{effect}.{part}", effect, typical, lower)


def _scale(effect: str, part: str, typical: float) -> Coordinate:
    return Coordinate(f"{effect}.{part}", effect, 0.3, -INFINITY, _WIDTH_SD, math.log(typical))


@dataclass(frozen=True)
class Candidate:
    """One effect at one place: what a fit adds to the model.

    Attributes
    ----------
    effect : str
    place : int or None
        Link or segment, from 1.
    sizes : tuple of Coordinate
        Zero when the effect is absent.
    scales : tuple of Coordinate
        Logs that mean nothing at zero size.
    """

    effect: str
    place: int | None
    sizes: tuple[Coordinate, ...]
    scales: tuple[Coordinate, ...] = ()

    @property
    def label(self) -> str:
        """Name with the place, for people."""
        return self.effect if self.place is None else f"{self.effect}[{self.place}]"

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """Sizes, then scales."""
        return self.sizes + self.scales


def all_candidates(links: int, names: Iterable[str] | None = None) -> tuple[Candidate, ...]:
    """Return every effect at every place of a robot with `links` links (or those of the given names)."""
    from srs_opt.model.effects import all_effects

    found: list[Candidate] = []
    for name, effect in all_effects().items():
        if names is not None and name not in names:
            continue
        size = effect.size
        place = next((p for p in effect.parameters if p.place), None)
        if name in _VECTORS:
            parts = [_sizes(name, part, size.typical) for part in _VECTORS[name]]
            found.append(Candidate(name, None, tuple(parts), _SCALES.get(name, ())))
        elif place is not None:
            count = links if place.place == "link" else links - 1
            for k in range(1, count + 1):
                part = _sizes(name, f"{size.name}[{k}]", size.typical, size.lower)
                found.append(Candidate(name, k, (part,)))
        else:
            part = _sizes(name, size.name, size.typical, size.lower)
            found.append(Candidate(name, None, (part,), _SCALES.get(name, ())))
    return tuple(found)


_VECTORS = {
    "tether_pull": ("x_n", "y_n"),
    "floor_slope": ("x", "y"),
    "marker_offset": ("dx_m", "dy_m"),
}
_SCALES = {
    "hysteresis": (_scale("hysteresis", "log_width", 4.0),),
    "stribeck": (_scale("stribeck", "log_speed", 0.08),),
    "tether_pull": (_scale("tether_pull", "log_nearness", 0.8),),
}


def effect_spec(candidate: Candidate, values: Mapping[str, float]) -> dict[str, Any]:
    """Return the robot file's entry for a fitted candidate."""
    name = candidate.effect
    own = {c.name.split(".", 1)[1]: values.get(c.name, c.start) for c in candidate.coordinates}
    if name == "tether_pull":
        force = math.hypot(own["x_n"], own["y_n"])
        away = math.exp(-own["log_nearness"]) / max(force, 1e-12)
        return {"name": name, "force_n": force, "ax_m": away * own["x_n"], "ay_m": away * own["y_n"]}
    if name == "floor_slope":
        direction = math.atan2(own["y"], own["x"])
        return {"name": name, "angle": math.hypot(own["x"], own["y"]), "direction": direction}
    if name == "hysteresis":
        return {"name": name, "ratio": own["ratio"], "width": math.exp(own["log_width"])}
    if name == "stribeck":
        return {"name": name, "excess": own["excess"], "speed": math.exp(own["log_speed"])}
    if candidate.place is not None:
        key, value = next(iter(own.items()))
        part = key.split("[")[0]
        place = "link" if name == "single_wheel_toe" else "segment"
        return {"name": name, part: value, place: candidate.place}
    return {"name": name, **own}

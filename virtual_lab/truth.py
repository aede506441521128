"""What is really in the laboratory: the robot's true values and everything that is hidden."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from virtual_lab.catalogue import check_effect, find_kind
from virtual_lab.errors import LabError

MIN_LINKS, MAX_LINKS = 3, 64
ENGINES = ("equations", "dart")


@dataclass(frozen=True)
class Parameters:
    """The robot's values, under the keys of a robot file (SI units, pressure in kPa).

    What has no bending stiffness, segments or gaps, is rigid (None).
    """

    links: int = 5
    segment_length_m: float = 0.037
    gap_length_m: float = 0.012
    link_mass_kg: float = 0.030
    link_inertia_kg_m2: float = 1e-6
    friction_law: str = "per_axis"
    friction_tangential: float = 0.043
    friction_normal: float = 0.57
    curvature_per_pressure_1_m_kpa: float = 0.35
    tau1_s: float = 0.08
    tau2_s: float = 0.05
    gravity_m_s2: float = 9.81
    bending_stiffness_n_m2: float | None = None
    bending_relaxation_s: float | None = None
    gap_stiffness_n_m2: float | None = None
    valve_delay_s: float = 0.0

    def __post_init__(self) -> None:
        if not MIN_LINKS <= self.links <= MAX_LINKS:
            raise LabError(f"a robot has {MIN_LINKS} to {MAX_LINKS} links, found {self.links}")
        if self.friction_law not in ("per_axis", "cone"):
            raise LabError(f"friction_law must be per_axis or cone, found '{self.friction_law}'")
        for key in ("segment_length_m", "link_mass_kg", "tau1_s", "tau2_s", "gravity_m_s2"):
            if not getattr(self, key) > 0:
                raise LabError(f"{key} must be above 0, found {getattr(self, key)!r}")
        for key in ("bending_stiffness_n_m2", "bending_relaxation_s", "gap_stiffness_n_m2"):
            value = getattr(self, key)
            if value is not None and not value > 0:
                raise LabError(f"{key} must be above 0, found {value!r}")

    def to_record(self) -> dict[str, Any]:
        """Return the values that a robot file of this robot holds."""
        return {key: value for key, value in dataclasses.asdict(self).items() if value is not None}


@dataclass(frozen=True)
class Scatter:
    """Relative standard deviation of friction and curvature from trial to trial."""

    friction_tangential: float = 0.03
    friction_normal: float = 0.03
    curvature: float = 0.01


DOCUMENTED = Parameters()
USUAL_SCATTER = Scatter()


@dataclass(frozen=True)
class Truth:
    """A laboratory with everything that is hidden in it.

    Attributes
    ----------
    parameters : Parameters
        True values, which the bench measured with errors.
    effects, unlisted : tuple of mapping
        ``{"name": ..., parameter: value}``; `unlisted` effects are in no list. Any number at once.
    friction_speed_m_s : float
        Speed over which friction is smoothed; 0.0003 is finer than the models under test.
    scatter : Scatter
        Trial-to-trial scatter.
    bench : Parameters or None
        What the robot file says; None: the true values.
    relative_sd : mapping
        How well the robot file claims to know each value.
    documented : mapping
        What else the robot file says.
    engine : {"equations", "dart"}
        What moves the body: the laboratory's equations of motion, or a physics engine.
    """

    parameters: Parameters = DOCUMENTED
    effects: tuple[Mapping[str, Any], ...] = ()
    unlisted: tuple[Mapping[str, Any], ...] = ()
    friction_speed_m_s: float = 0.0003
    scatter: Scatter = USUAL_SCATTER
    bench: Parameters | None = None
    relative_sd: Mapping[str, float] = field(default_factory=dict)
    documented: Mapping[str, Any] = field(default_factory=lambda: {"name": "WPI SRS", "effects": []})
    engine: str = "equations"

    def __post_init__(self) -> None:
        object.__setattr__(self, "effects", tuple(dict(e) for e in self.effects))
        object.__setattr__(self, "unlisted", tuple(dict(e) for e in self.unlisted))
        for effects, listed in ((self.effects, True), (self.unlisted, False)):
            for effect in effects:
                check_effect(effect, self.parameters.links)
                if find_kind(effect["name"]).listed is not listed:
                    place = "effects" if not listed else "unlisted"
                    raise LabError(f"effect '{effect['name']}' belongs under '{place}'")
        if self.engine not in ENGINES:
            raise LabError(f"engine must be one of {', '.join(ENGINES)}, found '{self.engine}'")
        if not self.friction_speed_m_s > 0:
            raise LabError(f"friction_speed_m_s must be above 0, found {self.friction_speed_m_s!r}")

    def hidden(self, *, tether: bool = True) -> list[tuple[str, dict[str, float]]]:
        """Return name and parameters of every effect at work, less those of the hose without `tether`."""
        found = [
            (str(effect["name"]), check_effect(effect, self.parameters.links))
            for effect in (*self.effects, *self.unlisted)
        ]
        return [(n, v) for n, v in found if tether or find_kind(n).part != "tether"]

    def to_record(self) -> dict[str, Any]:
        """Return everything as plain data, for truth.json."""
        return dataclasses.asdict(self)

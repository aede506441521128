"""What a manoeuvre begins with, where it shall end, and the room that it has."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from srs_opt.errors import InputError
from srs_opt.gait import Gait
from srs_opt.manoeuvre.space import Space
from srs_opt.manoeuvre.valves import gait_end
from srs_opt.orbit.steady import Orbit, travelling
from srs_opt.robot import Robot
from srs_opt.simulate.integrate import Integrator

OBJECTIVES = ("time", "air", "space")


@dataclass(frozen=True)
class Start:
    """The state at time 0.

    Attributes
    ----------
    state : array (nx,)
    gait : Gait or None
        The gait that the robot comes from, at its time 0; None: straight, at rest, vented.
    """

    state: np.ndarray
    gait: Gait | None = None

    @staticmethod
    def at_rest(run: Integrator) -> Start:
        """Return the straight robot at rest at the origin, heading along x."""
        return Start(run.rest())

    @staticmethod
    def in_gait(run: Integrator, robot: Robot, gait: Gait) -> Start:
        """Return the steady gait at its time 0, the centre of mass at the origin, travelling along x."""
        return Start(travelling(robot, gait, run.structure.model), gait)

    @property
    def valves(self) -> tuple[int, ...] | None:
        """The valves just before time 0; None where they are vented."""
        return None if self.gait is None else gait_end(self.gait)[0]

    def ages_s(self, segments: int) -> tuple[float, ...]:
        """Return for how long each segment's valves have stood at time 0."""
        return (math.inf,) * segments if self.gait is None else gait_end(self.gait)[1]


@dataclass(frozen=True)
class End:
    """What must hold at the end; what is None does not matter.

    Attributes
    ----------
    past_m : float, optional
        The centre of mass is at least so far ahead (negative: behind), along the heading of the start.
    turn_rad : float, optional
        The mean heading has turned by at least so much, + left.
    pose : (x m, y m, heading rad), optional
        Centre of mass and mean heading.
    within_m : float, optional
        The centre of mass never leaves the start by more than this.
    rest : bool
        At rest, vented and straight.
    orbit : Orbit, optional
        Of the gait that is played on from there, at its time 0.
    """

    past_m: float | None = None
    turn_rad: float | None = None
    pose: tuple[float, float, float] | None = None
    within_m: float | None = None
    rest: bool = False
    orbit: Orbit | None = None

    def __post_init__(self) -> None:
        wanted = (self.past_m, self.turn_rad, self.pose, self.orbit)
        if not self.rest and all(w is None for w in wanted):
            raise InputError("a manoeuvre needs an end: --past, --turn, --pose, --rest or --to")
        if self.rest and self.orbit is not None:
            raise InputError("a manoeuvre ends at rest or in a gait, not both")
        for name, value in (("--past", self.past_m), ("--turn", self.turn_rad)):
            if value == 0:
                raise InputError(f"{name} must not be 0")
        if self.within_m is not None and self.within_m <= 0:
            raise InputError(f"--within must be above 0 m, found {self.within_m:g}")


@dataclass(frozen=True)
class ValveBounds:
    """What valves, regulator and segments can do.

    Attributes
    ----------
    pressure_kpa : (low, high)
        Of the one pressure of the manoeuvre.
    min_dwell_s, tick_s : float
    max_curvature_1_m : float, optional
    """

    pressure_kpa: tuple[float, float] = (25.0, 55.0)
    min_dwell_s: float = 0.02
    tick_s: float = 0.001
    max_curvature_1_m: float | None = None

    def __post_init__(self) -> None:
        low, high = self.pressure_kpa
        if not (0 < low <= high and math.isfinite(high)):
            raise InputError(f"pressure limits must be 0 < low <= high, found {low:g} {high:g} kPa")
        if self.max_curvature_1_m is not None and self.max_curvature_1_m <= 0:
            raise InputError(f"--max-curvature must be above 0 1/m, found {self.max_curvature_1_m:g}")

    @property
    def dwell_s(self) -> float:
        """Least dwell in whole ticks."""
        return math.ceil(self.min_dwell_s / self.tick_s - 1e-6) * self.tick_s


@dataclass(frozen=True)
class Task:
    """A manoeuvre that is wanted.

    Attributes
    ----------
    start : Start
    end : End
    objective : {"time", "air", "space"}
        Least time; least air; the smallest disc that holds the body throughout.
    space : Space or None
    bounds : ValveBounds
    longest_s : float or None
        Time that it may take; needed where time is not the objective.
    """

    start: Start
    end: End
    objective: str = "time"
    space: Space | None = None
    bounds: ValveBounds = field(default_factory=ValveBounds)
    longest_s: float | None = None

    @property
    def pressure_kpa(self) -> float | None:
        """The pressure where it is given: by the gait at the end, else by the one at the start."""
        if self.end.orbit is not None:
            return self.end.orbit.gait.pressure_kpa
        return None if self.start.gait is None else self.start.gait.pressure_kpa

    @property
    def pressure_is_free(self) -> bool:
        """Whether the optimization may choose the pressure."""
        return self.pressure_kpa is None

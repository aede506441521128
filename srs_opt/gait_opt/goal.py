"""What is wanted of a gait and what limits it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from srs_opt.errors import InputError
from srs_opt.gait_opt.objectives.built_in import SPEED
from srs_opt.gait_opt.objectives.objective import Objective
from srs_opt.gait_opt.objectives.registry import objective_named
from srs_opt.gait_opt.settings import GOAL
from srs_opt.robot import Robot

SIDES = {"left": 1.0, "right": -1.0}


@dataclass(frozen=True)
class Goal:
    """What is wanted.

    Attributes
    ----------
    objective : Objective or str
        One of one's own, or the name of a built-in or registered one: fastest (`speed`); least energy per
        weight and distance (`transport`); tightest (or, with a radius or turn rate, fastest) turn (`turn`);
        most turn rate (`pivot`); smallest total width of the swept band (`slim`).
    speed_m_s : float, optional
        Wanted speed: the least one for transport, turn and slim. A search for it asks first whether the
        fastest gait makes it.
    radius_m, turn_rate_rad_s : float, optional
        Wanted turn, + left. Without either the gait runs straight, where the objective does not turn.
    envelope_m : float, optional
        Largest total width of the swept band, body width included.
    least_speed_m_s : float, optional
        Speed below which no gait is taken; without, 0.02 m/s for objectives that would otherwise bring the
        robot to a stop (transport, turn, slim), none for the others.
    side : {"left", "right"}
        Where turns without a wanted radius or turn rate (tightest, pivot) go.
    """

    objective: Objective | str = "speed"
    speed_m_s: float | None = None
    radius_m: float | None = None
    turn_rate_rad_s: float | None = None
    envelope_m: float | None = None
    least_speed_m_s: float | None = None
    side: str = "left"

    def __post_init__(self) -> None:
        if isinstance(self.objective, str):  # kept as the object: other processes need not know its name
            object.__setattr__(self, "objective", objective_named(self.objective))
        aim = self.aim
        if aim.needs_speed and not self.speed_m_s:
            raise InputError(f"objective {aim.name} needs a wanted speed: --speed M_S")
        if not aim.least_speed and self.speed_m_s is not None:
            raise InputError(
                f"--speed has no meaning for objective {aim.name}, which maximizes it; ask for "
                "slim, transport or turn at that speed, or give a --least-speed"
            )
        if self.radius_m is not None and self.radius_m == 0:
            raise InputError("a wanted radius must not be zero; --objective pivot turns about one place")
        if self.radius_m is not None and self.turn_rate_rad_s is not None:
            raise InputError("give a radius or a turn rate, not both")
        if self.wants_turn and aim.turn == "side":
            raise InputError(
                f"objective {aim.name} chooses its turn itself: without --radius and --turn-rate"
            )
        if self.speed_m_s is not None and self.speed_m_s < 0:
            raise InputError("a wanted speed must be above zero; --table also holds the gaits backwards")
        if self.least_speed_m_s is not None and not 0 < self.least_speed_m_s < math.inf:
            raise InputError(f"the least speed must be above 0 m/s, found {self.least_speed_m_s:g}")
        if self.side not in SIDES:
            raise InputError(f"side must be left or right, found '{self.side}'")

    @property
    def aim(self) -> Objective:
        """The objective that counts for what is wanted."""
        objective = self.objective
        assert not isinstance(objective, str)
        return objective if self.wants_turn or objective.unless_turn is None else objective.unless_turn

    @property
    def name(self) -> str:
        """The objective's name, as it was asked for."""
        objective = self.objective
        assert not isinstance(objective, str)
        return objective.name

    @property
    def wants_turn(self) -> bool:
        """Whether a certain radius or turn rate is wanted."""
        return self.radius_m is not None or self.turn_rate_rad_s is not None

    @property
    def turn(self) -> str:
        """Return "radius" or "rate" where one is wanted, else what the objective asks: one of `TURNS`."""
        if self.radius_m is not None:
            return "radius"
        return "rate" if self.turn_rate_rad_s is not None else self.aim.turn

    @property
    def sense(self) -> float:
        """+1 where turns should go left, -1 right."""
        return SIDES[self.side]

    @property
    def floor_m_s(self) -> float | None:
        """Speed that a gait must have at least; None: any."""
        if self.speed_m_s:
            return self.speed_m_s
        if self.least_speed_m_s is None and self.aim.least_speed:
            return GOAL.least_speed_m_s
        return self.least_speed_m_s

    @property
    def only_fast(self) -> bool:
        """Whether nothing is wanted but speed straight ahead."""
        return self.aim.quick and self.turn == "straight" and self.envelope_m is None

    @property
    def merit_is_speed(self) -> bool:
        """Whether the gait that runs fastest is the best."""
        return self.aim.merit is SPEED.merit


@dataclass(frozen=True)
class Limits:
    """What limits the gait.

    Attributes
    ----------
    frequency_hz, pressure_kpa : (low, high)
    min_dwell_s : float
        Least time between two switches of one valve pair.
    tick_s : float
        The controller's tick: switches and the period are whole ticks.
    max_curvature_1_m : float, optional
    valve_delay_s : float, optional
        Instead of the robot's own; it shifts the whole cycle and changes no steady gait.
    chamber_volume_m3 : float, optional
        Volume that one fill takes; without, `chamber_volume_m3`.
    """

    frequency_hz: tuple[float, float] = (1.0, 2.0)
    pressure_kpa: tuple[float, float] = (41.0, 55.0)
    min_dwell_s: float = 0.02
    tick_s: float = 0.001
    max_curvature_1_m: float | None = None
    chamber_volume_m3: float | None = None

    def __post_init__(self) -> None:
        (slow, fast), (weak, strong) = self.frequency_hz, self.pressure_kpa
        if not 0 < slow <= fast < math.inf:
            raise InputError(f"frequency limits must be 0 < low <= high, found {slow:g} {fast:g} Hz")
        if not (0 <= weak <= strong < math.inf and strong > 0):
            raise InputError(f"pressure limits must be 0 <= low <= high, found {weak:g} {strong:g} kPa")
        for name, value, unit in (
            ("a tick", self.tick_s, "s"),
            ("the largest curvature", self.max_curvature_1_m, "1/m"),
            ("a chamber's volume", self.chamber_volume_m3, "m^3"),
        ):
            if value is not None and not 0 < value < math.inf:
                raise InputError(f"{name} must be above 0 {unit}, found {value:g}")
        if not 0 <= self.min_dwell_s < math.inf:
            raise InputError(f"a dwell must be at least 0 s, found {self.min_dwell_s:g}")
        if GOAL.least_ticks * self.tick_s * slow > 1:
            raise InputError(
                f"a tick of {self.tick_s:g} s is too long: the longest period, {1 / slow:g} s, must hold "
                f"{GOAL.least_ticks} of them at least"
            )
        least, most = tick_counts(self.frequency_hz, self.tick_s)
        if least > most:
            raise InputError(
                f"no period of whole ticks of {self.tick_s:g} s lies within {slow:g} ... {fast:g} Hz; the "
                f"nearest are {1 / (least * self.tick_s):.4g} and {1 / (most * self.tick_s):.4g} Hz"
            )
        if self.min_dwell_s * 2 * self.frequency_hz[0] > 1:
            raise InputError(
                f"a dwell of {self.min_dwell_s:g} s leaves no room for two switches in the longest period, "
                f"{1 / self.frequency_hz[0]:g} s; lower --min-dwell or the lowest --frequency"
            )

    def for_robot(self, robot: Robot) -> Limits:
        """Return the limits with the robot's own chamber volume filled in."""
        volume = self.chamber_volume_m3
        return replace(self, chamber_volume_m3=chamber_volume_m3(robot) if volume is None else volume)


def tick_counts(frequency_hz: tuple[float, float], tick_s: float) -> tuple[int, int]:
    """Return the fewest and most whole ticks of a period within the frequency limits.

    Where no whole number lies strictly within, `GOAL.frequency_excess` of the limits is used up.
    """
    fewest, longest = 1 / frequency_hz[1] / tick_s, 1 / frequency_hz[0] / tick_s
    # 1e-6: limits that are whole ticks but for rounding are within
    least, most = math.ceil(fewest - 1e-6), math.floor(longest + 1e-6)
    if least <= most:
        return least, most
    return math.ceil(fewest / (1 + GOAL.frequency_excess)), math.floor(longest / (1 - GOAL.frequency_excess))


def chamber_volume_m3(robot: Robot) -> float:
    """Return the assumed volume of an air chamber: a tube of length l, its bore a sixth of the body's width.

    The paper prints none; for the built-in robot this is 1.3 ml.
    """
    bore = GOAL.bore_over_width * robot.body_width_m
    return math.pi / 4 * bore**2 * robot.segment_length_m


def air_work_j(intervals: int, pressure_kpa: Any, volume_m3: Any) -> Any:
    """Return the energy of a cycle's air, J: every switch fills one chamber, at volume x pressure.

    `intervals` counts on-intervals of all segments; each begins with a fill on the left and ends with one
    on the right. Numbers or expressions, like pressure and volume.
    """
    return fill_work_j(2 * intervals, pressure_kpa, volume_m3)


def fill_work_j(fills: int, pressure_kpa: Any, volume_m3: Any) -> Any:
    """Return the energy of the air in chambers that are filled, J: volume x pressure each."""
    # 1e3 Pa per kPa
    return 1e3 * fills * volume_m3 * pressure_kpa

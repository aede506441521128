"""What is wanted of a gait and what limits it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from srs_opt.errors import InputError
from srs_opt.robot import Robot

OBJECTIVES = ("speed", "transport", "turn", "slim")
CHAMBER_OVER_WIDTH = 1 / 6  # assumed diameter of an air chamber over the body's width


@dataclass(frozen=True)
class Goal:
    """What is wanted.

    Attributes
    ----------
    objective : {"speed", "transport", "turn", "slim"}
        Fastest; least energy per weight and distance; tightest (or, with a radius or turn rate, fastest)
        turn; smallest total width of the swept band.
    speed_m_s : float, optional
        Wanted speed (least speed for transport, turn and slim); negative backwards.
    radius_m, turn_rate_rad_s : float, optional
        Wanted turn, + left. Without either the gait runs straight.
    envelope_m : float, optional
        Largest total width of the swept band, body width included.
    """

    objective: str = "speed"
    speed_m_s: float | None = None
    radius_m: float | None = None
    turn_rate_rad_s: float | None = None
    envelope_m: float | None = None

    def __post_init__(self) -> None:
        if self.objective not in OBJECTIVES:
            raise InputError(f"objective must be one of {', '.join(OBJECTIVES)}, found '{self.objective}'")
        if self.objective == "slim" and not self.speed_m_s:
            raise InputError("objective slim needs a wanted speed: --speed M_S")
        if self.objective == "speed" and self.speed_m_s is not None:
            raise InputError(
                "--speed has no meaning for objective speed, which takes all that it gets; ask for slim, "
                "transport or turn at that speed"
            )
        if self.radius_m is not None and self.radius_m == 0:
            raise InputError("a wanted radius must not be zero")
        if self.radius_m is not None and self.turn_rate_rad_s is not None:
            raise InputError("give a radius or a turn rate, not both")
        if self.speed_m_s is not None and self.speed_m_s < 0:
            raise InputError("a wanted speed must be above zero; --table also holds the gaits backwards")

    @property
    def only_fast(self) -> bool:
        """Whether nothing is wanted but speed straight ahead."""
        wishes = (self.radius_m, self.turn_rate_rad_s, self.envelope_m)
        return self.objective == "speed" and all(w is None for w in wishes)

    @property
    def tightest(self) -> bool:
        """Whether the smallest radius is sought."""
        return self.objective == "turn" and self.radius_m is None and self.turn_rate_rad_s is None


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
        for name, (low, high), unit in (
            ("frequency", self.frequency_hz, "Hz"),
            ("pressure", self.pressure_kpa, "kPa"),
        ):
            if not (math.isfinite(low) and math.isfinite(high) and 0 < low <= high):
                raise InputError(f"{name} limits must be 0 < low <= high, found {low:g} {high:g} {unit}")
        if self.tick_s <= 0:
            raise InputError(f"tick must be above 0 s, found {self.tick_s:g}")
        if self.min_dwell_s * 2 * self.frequency_hz[0] > 1:
            raise InputError(
                f"a dwell of {self.min_dwell_s:g} s leaves no room for two switches in the longest period, "
                f"{1 / self.frequency_hz[0]:g} s; lower --min-dwell or the lowest --frequency"
            )

    def for_robot(self, robot: Robot) -> Limits:
        """Return the limits with the robot's own chamber volume filled in."""
        volume = self.chamber_volume_m3
        return replace(self, chamber_volume_m3=chamber_volume_m3(robot) if volume is None else volume)


def chamber_volume_m3(robot: Robot) -> float:
    """Return the assumed volume of an air chamber: a tube of length l, its bore a sixth of the body's width.

    The paper prints none; for the built-in robot this is 1.3 ml.
    """
    bore = CHAMBER_OVER_WIDTH * robot.body_width_m
    return math.pi / 4 * bore**2 * robot.segment_length_m


def air_work_j(intervals: int, pressure_kpa: float, volume_m3: float) -> float:
    """Return the energy of a cycle's air, J: every switch fills one chamber, at volume x pressure.

    `intervals` counts on-intervals of all segments; each begins with a fill on the left and ends with one
    on the right.
    """
    return 2 * intervals * volume_m3 * pressure_kpa * 1e3


def cost_of_transport(friction_j: float, air_j: float, distance_m: float, weight_n: float) -> float:
    """Return (friction work + air) / (weight x distance), all per cycle; no unit."""
    return (friction_j + air_j) / (weight_n * distance_m)

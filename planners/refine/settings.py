"""How a plan's cycles are optimized: windows, their limits, and the steps of the solver."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WindowSettings:
    """How the window moves along a plan.

    Attributes
    ----------
    cycles, kept : int
        Cycles of a window, and how many of them are kept when it moves on.
    steps : int
        Of the solver, of one window; half of it gains a fifth less in half the time.
    steps_per_s : float
        Steps at most per second of the plan, mending included: about 5 s of processor time. They are counted,
        so that what is found does not depend on the machine.
    least_steps : int
        Of a window that is mended; fewer leave it where it was.
    spares : tuple of float
        Factors on `WindowLimitSettings.spare`: every time that the certificate refuses, what comes from there
        on is optimized with the next one.
    least_gain_s : float
        A plan that is not faster by this is kept as found.
    tolerance : float
        Of the integration, body lengths per second; four times as much leaves derivatives off by a tenth at
        times.
    ticks_per_m : float
        Ticks of the valves' clock that a metre of missed clearance weighs when times are rounded: a tenth of
        a millimetre too near is worse than a tick to the farther side.
    """

    cycles: int = 6
    kept: int = 3
    steps: int = 28
    steps_per_s: float = 26.0
    least_steps: int = 6
    spares: tuple[float, ...] = (1.0, 2.5, 5.0)
    least_gain_s: float = 0.01
    tolerance: float = 1.27e-5
    ticks_per_m: float = 1e4


@dataclass(frozen=True)
class WindowLimitSettings:
    """What a window keeps; lengths in body lengths, speeds in body lengths per second.

    Attributes
    ----------
    look_s : float
        Between instants at which the body is measured; the built-in robot moves 3 mm meanwhile.
    near : float
        Walls farther from the body than this beyond the margin do not count: a step moves it by less.
    spare : float
        Beyond margin and goal: for ticks, chords between the body's points, and integration.
    place_off, heading_rad, speed_off : float
        Tolerances of a window's end. Smaller leaves less to gain, larger may make what the plan does next
        impossible.
    bend : float
        And of its bends: a share of the largest one, or the heading would tell little of the course.
    heading_share : float
        Share of the goal's tolerance of the heading that is used.
    """

    look_s: float = 0.005
    near: float = 0.06
    spare: float = 1.2e-3
    place_off: float = 0.002
    heading_rad: float = 0.002
    speed_off: float = 0.1
    bend: float = 0.15
    heading_share: float = 0.99


@dataclass(frozen=True)
class WindowStepSettings:
    """Sequential linear programming in a trust region, whose radius (`reach`) is a time.

    Attributes
    ----------
    penalty_per_m : float
        Seconds per metre of violation in the merit: half a metre per second costs 2.
    fractions : tuple of float
        Of a step, simulated side by side; the best is taken.
    first_reach_s, least_reach_s, most_reach_s : float
        The trust region's radius at first, the one below which the search ends, and the largest.
    shrink, grow : float
        Factors on it after a step without gain, and after a whole step.
    pressure_per_s : float
        kPa that a step may change per second of reach.
    stretch : float
        Times the reach that a cycle may be stretched by.
    gain_s : float
        A step that gains less is idle.
    most_idle : int
        Idle steps, one after the other, after more of which the search ends.
    """

    penalty_per_m: float = 20.0
    fractions: tuple[float, ...] = (1.0, 0.5, 0.2, 0.05)
    first_reach_s: float = 0.01
    least_reach_s: float = 5e-4
    most_reach_s: float = 0.04
    shrink: float = 0.25
    grow: float = 2.0
    pressure_per_s: float = 100.0
    stretch: float = 4.0
    gain_s: float = 5e-4
    most_idle: int = 2


WINDOW = WindowSettings()
WINDOW_LIMIT = WindowLimitSettings()
WINDOW_STEP = WindowStepSettings()

"""A whole simulated trial: a gait from rest, its steady motion, and how far to trust it."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from srs_opt.errors import InputError
from srs_opt.gait import Gait, check_gait
from srs_opt.geometry import rotate
from srs_opt.result import Result
from srs_opt.robot import Robot
from srs_opt.simulate import compiled
from srs_opt.simulate.cycle_motion import CycleMotion, cycle_motion
from srs_opt.simulate.integrate import Integrator, Trajectory
from srs_opt.simulate.settings import INTEGRATION, MOTION
from srs_opt.simulate.shapes import centre_lines
from srs_opt.simulate.timeline import Timeline

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LONGEST_S, MOST_CYCLES = 100_000.0, 1_000_000
LEAST_CYCLES = 1e-6  # shorter ones drown in rounding


@dataclass(frozen=True, repr=False)
class Simulation(Result):
    """A simulated trial.

    Attributes
    ----------
    robot : Robot
    model : str
    gait : Gait or None
        None where valves were played once.
    trajectory : Trajectory
    speed_m_s, turn_rate_rad_s : float or None
        Means over the whole cycles of the second half; None when there are fewer than two cycles.
    radius_m : float or None
        Speed over turn rate, + left; None when straight.
    error_estimate : float or None
        Relative change of the distance per cycle when the tolerance is tightened sixteenfold.
    wall_s, compile_s : float
    """

    robot: Robot
    model: str
    gait: Gait | None
    trajectory: Trajectory
    speed_m_s: float | None
    turn_rate_rad_s: float | None
    radius_m: float | None
    error_estimate: float | None
    wall_s: float
    compile_s: float

    def to_dict(self) -> dict[str, Any]:
        """Return the means and how far to trust them; `trajectory` holds the motion."""
        keys = ("speed_m_s", "turn_rate_rad_s", "radius_m", "error_estimate", "wall_s", "compile_s")
        return {key: getattr(self, key) for key in keys}

    def in_words(self) -> str:
        """Return the mean motion in one line."""
        if self.speed_m_s is None or self.turn_rate_rad_s is None:
            return "simulated; fewer than two whole cycles, so no mean speed"
        way = "straight"
        if self.radius_m is not None:
            way = f"radius {abs(self.radius_m):.3f} m to the {'left' if self.radius_m > 0 else 'right'}"
        error = self.error_estimate
        trust = f" (numerical error about {error:.1e})" if error is not None else ""
        return f"speed {self.speed_m_s:.4f} m/s, turn rate {self.turn_rate_rad_s:+.4f} rad/s, {way}{trust}"

    def figure(self) -> Figure:
        """Return the picture of path, body and curvatures."""
        from srs_opt.simulate.figures import simulation_figure

        return simulation_figure(self)


def simulate(
    robot: Robot, gait: Gait, duration_s: float, model: str | None = None, heading_rad: float = 0.0
) -> Simulation:
    """Run `gait` from the straight robot at rest for `duration_s`, every period integrated.

    Raises
    ------
    InputError
        If the duration is out of range, in seconds or cycles, or the gait does not fit the robot.
    """
    if not 0 < duration_s <= LONGEST_S:
        raise InputError(f"duration must be above 0 and at most {LONGEST_S:g} s, found {duration_s:g}")
    if duration_s > MOST_CYCLES * gait.period_s:
        raise InputError(
            f"{duration_s:g} s at {1 / gait.period_s:g} Hz are more than {MOST_CYCLES} cycles; "
            "lower the duration or the frequency"
        )
    if duration_s < LEAST_CYCLES * gait.period_s:
        raise InputError(
            f"{duration_s:g} s at {1 / gait.period_s:g} Hz are less than {LEAST_CYCLES:g} cycles; "
            "raise the duration or the frequency"
        )
    check_gait(robot, gait)
    before = compiled.compile_seconds
    run = Integrator(robot, model)
    start = run.rest(heading_rad=heading_rad)
    timeline = Timeline.of_gait(gait, duration_s)
    started = time.perf_counter()
    trajectory = run.integrate(timeline, start)
    wall = time.perf_counter() - started
    speed, turn_rate, radius = _second_half(run, trajectory, gait)
    error = _error_estimate(run, start, gait, duration_s)
    compile_s = compiled.compile_seconds - before
    name = model or robot.own_model
    return Simulation(robot, name, gait, trajectory, speed, turn_rate, radius, error, wall, compile_s)


def simulate_valves(
    robot: Robot, timeline: Timeline, model: str | None = None, start: np.ndarray | None = None
) -> Simulation:
    """Play valves once, from `start` (nx,) or from the straight robot at rest; no mean speeds.

    Raises
    ------
    InputError
        If an effect of the robot goes by a gait's frequency.
    """
    before = compiled.compile_seconds
    run = Integrator(robot, model)
    run.check_played_once()
    began = time.perf_counter()
    trajectory = run.integrate(timeline, run.rest() if start is None else start)
    wall = time.perf_counter() - began
    compile_s = compiled.compile_seconds - before
    name = model or robot.own_model
    return Simulation(robot, name, None, trajectory, None, None, None, None, wall, compile_s)


def _second_half(
    run: Integrator, trajectory: Trajectory, gait: Gait
) -> tuple[float | None, float | None, float | None]:
    # whole cycles, also where rounding leaves the last a little short
    cycles = int(trajectory.time_s[-1] / gait.period_s + 1e-9)
    if cycles < 2:
        return None, None, None
    motions = [motion_of_cycle(run, trajectory, gait, k) for k in range(cycles // 2, cycles)]
    speed = float(np.mean([m.speed_m_s for m in motions]))
    turn_rate = float(np.mean([m.turn_rate_rad_s for m in motions]))
    straight = motions[-1].radius_m is None
    return speed, turn_rate, None if straight or turn_rate == 0 else speed / turn_rate


def motion_of_cycle(run: Integrator, trajectory: Trajectory, gait: Gait, cycle: int) -> CycleMotion:
    """Return the motion over one whole cycle of a trajectory (cycle 0 starts at time 0)."""
    times = trajectory.time_s
    first = int(np.searchsorted(times, cycle * gait.period_s - 1e-9))
    last = int(np.searchsorted(times, (cycle + 1) * gait.period_s - 1e-9))
    pose, kappa = trajectory.pose[first : last + 1], trajectory.kappa[first : last + 1]
    pose = pose - np.array([pose[0, 0], pose[0, 1], 0.0])
    x, y = centre_lines(run, kappa).T
    x, y = rotate(pose[:, 2], x, y)
    elapsed = times[first : last + 1] - times[first]
    return cycle_motion(elapsed, pose, x + pose[:, 0], y + pose[:, 1], run.robot.body_width_m)


def _error_estimate(run: Integrator, start: np.ndarray, gait: Gait, duration_s: float) -> float | None:
    """Return the relative change of the path's length when a stretch is integrated again, finer."""
    stretch = Timeline.of_gait(gait, min(duration_s, MOTION.checked_cycles * gait.period_s))
    usual = run.integrate(stretch, start)
    finer = run.integrate(stretch, start, INTEGRATION.tolerance_m_s / MOTION.finer)
    distance = float(np.hypot(*np.diff(finer.pose[:, :2], axis=0).T).sum())
    if distance < 1e-6:
        return None
    return float(np.hypot(*(usual.pose[-1, :2] - finer.pose[-1, :2]))) / distance

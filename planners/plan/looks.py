"""What holds of a plan between two looks of a camera, and for how long it holds without any.

A plan of 90 m is certified as a motion of the model, but a start heading measured 5 mrad off ends half a
metre beside it. So two more things are certified, for every state within the tolerance of a look. Driven
closed-loop, the robot is measured where a cycle begins and the body keeps clear until the next one begins.
Driven open-loop, it is measured once, at the start.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.motion.robots import undelayed
from planners.plan.answer import Plan
from planners.plan.certify import clearances
from planners.plan.settings import PLAN_CERTIFICATE
from planners.search.problem import Problem
from planners.search.tree import at_rest
from srs_opt.errors import NoAnswerError
from srs_opt.gait_opt.robust import stiffness_interval
from srs_opt.geometry import compose, distance_along, points_in_room, relative
from srs_opt.orbit.body import integrator
from srs_opt.robot import Robot
from srs_opt.simulate.batched import run_batched
from srs_opt.simulate.shapes import centre_lines

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tolerance:
    """Of a look, half widths."""

    position_m: float
    heading_rad: float
    speed_m_s: float

    @staticmethod
    def usual(length_m: float) -> Tolerance:
        """Return what a camera tells of five links: 1 mm where the robot has 236, markers of 0.5 mm noise."""
        return Tolerance(length_m / 236, 0.005, length_m / 23.6)


@dataclass(frozen=True)
class Looks:
    """What holds for every state within the tolerance.

    Attributes
    ----------
    tolerance : Tolerance
    closed_loop_m : float
        The body keeps at least this clearance while it is measured at every cycle's begin.
    open_loop_m : float
        And this, measured at the start only; negative where it may touch.
    open_until_m : float
        Way of the centre of mass for which it cannot touch then.
    """

    tolerance: Tolerance
    closed_loop_m: float
    open_loop_m: float
    open_until_m: float

    @property
    def needs_looks(self) -> bool:
        """Whether the plan must be driven closed-loop."""
        return self.open_loop_m <= 0

    def to_record(self) -> dict[str, Any]:
        """Return the `looks` entry of the command's JSON."""
        return {
            "tolerance": {key: round(value, 9) for key, value in asdict(self.tolerance).items()},
            "closed_loop_m": round(self.closed_loop_m, 6),
            "closed_loop": self.closed_loop_m > 0,
            "open_loop_m": round(self.open_loop_m, 6),
            "open_loop": self.open_loop_m > 0,
            "open_until_m": round(self.open_until_m, 4),
        }

    def in_words(self) -> str:
        """Return a line for people."""
        t = self.tolerance
        within = f"{1e3 * t.position_m:g} mm, {1e3 * t.heading_rad:g} mrad and {1e3 * t.speed_m_s:g} mm/s"
        closed = (
            f"the body keeps {1e3 * self.closed_loop_m:.1f} mm"
            if self.closed_loop_m > 0
            else f"it may touch (by {-1e3 * self.closed_loop_m:.1f} mm)"
        )
        if self.needs_looks:
            first = f"to be driven closed-loop: without looks it is clear for {self.open_until_m:.2f} m only"
        else:
            first = f"clear without looks too, by {1e3 * self.open_loop_m:.1f} mm"
        return f"{first}; measured every cycle within {within}, {closed}"


def looks(problem: Problem, plan: Plan, tolerance: Tolerance | None = None) -> Looks:
    """Return what holds of a certified plan between looks and without."""
    tolerance = tolerance or Tolerance.usual(problem.robot.length_m)
    open_m, until_m = _open_loop(problem, plan, tolerance)
    return Looks(tolerance, _closed_loop(problem, plan, tolerance), open_m, until_m)


def _open_loop(problem: Problem, plan: Plan, tolerance: Tolerance) -> tuple[float, float]:
    """Return the least clearance and the way for which it is positive.

    At rest there is no speed to be wrong; place and heading move the whole motion rigidly, a heading by the
    distance from the start. A calibrated drive's uncertainty grows with the way. Where the stiffness is known
    with a deviation, the plan is played on the bodies at both ends of its interval too.
    """
    c = plan.certificate
    ways = [(c.pose, c.lines, c.room_m)]
    for other in stiffness_interval(problem.robot)[1:]:
        try:
            ways.append(_played(problem, plan, other))
        except NoAnswerError:
            return float("-inf"), 0.0
    least_m, until_m = [], []
    for pose, lines, room_m in ways:
        far = np.hypot(*(lines - pose[0, :2]).transpose(2, 0, 1)).max(axis=1)
        way = distance_along(pose[:, :2])
        tube = tolerance.position_m + tolerance.heading_rad * far + problem.drive.margin_m(1.0) * way
        left = room_m - tube
        bad = np.flatnonzero(left <= 0)
        least_m.append(float(left.min()))
        until_m.append(float(way[bad[0]] if bad.size else way[-1]))
    return min(least_m), min(until_m)


def _played(problem: Problem, plan: Plan, robot: Robot) -> tuple[Array, Array, Array]:
    """Return poses, bodies and their clearances while another robot plays the plan's valves."""
    run, start = integrator(undelayed(robot), problem.gaits.model), problem.start
    state, before, ended_s = run.rest(start.x, start.y, start.heading), problem.motion.rest, 0.0
    pose, kappa = [], []
    for gait in plan.gaits:
        trajectory = problem.bent(run.integrate(problem.joints.timeline(before, gait), state), before, gait)
        seen = np.flatnonzero(trajectory.time_s + ended_s <= plan.certificate.time_s[-1] + 1e-9)
        seen = seen[:: PLAN_CERTIFICATE.look_nodes]
        pose.append(trajectory.pose[seen])
        kappa.append(trajectory.kappa[seen])
        state, before, ended_s = trajectory.final, gait, ended_s + trajectory.time_s[-1]
    poses = np.concatenate(pose)
    lines = points_in_room(centre_lines(run, np.concatenate(kappa)), poses)
    return poses, lines, clearances(problem, lines)


def _closed_loop(problem: Problem, plan: Plan, tolerance: Tolerance) -> float:
    """Return the least clearance over all cycles, each begun anywhere within the tolerance.

    Every cycle is simulated with either extreme of speed and turned to either extreme of heading; the place
    moves it rigidly by at most its tolerance, and a calibrated drive leaves a tube.
    """
    root, c = at_rest(problem), plan.certificate
    begins = [root.state, *c.states[:-1]]
    before = [root.gait, *plan.gaits[:-1]]
    ends_s = np.cumsum(problem.motion.periods(plan.gaits))
    keys, searches = [], []
    for k, (state, b, gait) in enumerate(zip(begins, before, plan.gaits)):
        if k and ends_s[k - 1] >= c.time_s[-1]:
            break
        for off in (-tolerance.speed_m_s, tolerance.speed_m_s) if k else (0.0,):
            moved = state.copy()
            moved[3] += off
            keys.append((k, b, gait))
            searches.append(problem.integrator.travel(problem.joints.timeline(b, gait), moved))
    least_m = float("inf")
    for (k, b, gait), found in zip(keys, run_batched(searches)):
        if isinstance(found, NoAnswerError):
            return float("-inf")
        trajectory = problem.bent(found, b, gait)
        begun_s = ends_s[k - 1] if k else 0.0
        seen = np.flatnonzero(trajectory.time_s + begun_s <= c.time_s[-1] + 1e-9)
        seen = seen[:: PLAN_CERTIFICATE.look_nodes]
        pose = trajectory.pose[seen]
        body = centre_lines(problem.integrator, trajectory.kappa[seen])
        tube = tolerance.position_m + problem.bending.tube_m(pose, problem.motion.row(gait))
        for turn in (-tolerance.heading_rad, 0.0, tolerance.heading_rad):
            lines = points_in_room(body, _turned(pose, turn))
            least_m = min(least_m, _least(problem, lines, tube))
    return least_m


def _turned(pose: Array, turn: float) -> Array:
    """Return poses (n, 3) turned about the first one."""
    return compose(pose[0] + [0.0, 0.0, turn], relative(pose[0], pose))


def _least(problem: Problem, lines: Array, tube: Array) -> float:
    """Return the least clearance of bodies less what each may be off; exact where it decides."""
    roughly = problem.body.estimate(lines) - tube
    error_m = problem.field.error_m
    close = roughly - error_m <= roughly.min() + error_m
    return float((problem.body.exact(lines[close]) - tube[close]).min())

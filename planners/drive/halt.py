"""Coming to rest: vent at once, or brake with another gait for a cycle first, whatever leaves more room.

A vented body straightens while it rolls on, and near a wall that may be the one thing that touches it. The
true robot may roll farther than the planned one, so a smoother one is looked at too.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planners.drive.contact import BodyWatch
from planners.motion.robots import undelayed
from planners.search.problem import Problem
from srs_opt.errors import NoAnswerError
from srs_opt.orbit.steady import integrator
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.timeline import Timeline

COAST_S = 1.5  # watched after the valves have been vented
ENOUGH_MARGINS = 0.5  # of the margin: venting at once is good enough where the models keep so much
SMOOTHER = 0.8  # of the friction


def halt(problem: Problem, state: NDArray[np.float64]) -> Timeline:
    """Return the valves' timeline that brings the robot to rest farthest from the walls.

    Parameters
    ----------
    problem : Problem
    state : array
        Of the planned robot's model; forward speed in entry 3.
    """
    robot = problem.robot
    smoother = robot.with_values(
        friction_tangential=SMOOTHER * robot.friction_tangential,
        friction_normal=SMOOTHER * robot.friction_normal,
    )
    runs = (problem.run, integrator(undelayed(smoother), problem.gaits.model))
    vent = Timeline.vent(robot.segments, COAST_S, 0.0)
    best, most_m = vent, _least_room(problem, runs, state, vent)
    forward = float(state[3]) > 0
    brakes = [e.gait for e in problem.gaits.gaits if (e.speed_m_s > 0) != forward]
    steers = [e.gait for e in problem.gaits.gaits if (e.speed_m_s > 0) == forward]
    # braking for one cycle, then for two, then steering away: what is looked at last goes farthest
    for gaits, cycles in ((brakes, 1), (brakes, 2), (steers, 1)):
        if most_m >= ENOUGH_MARGINS * problem.margin_m:
            break
        for gait in gaits:
            way = Timeline.join([Timeline.of_gait(gait, cycles * gait.period_s), vent])
            room_m = _least_room(problem, runs, state, way, most_m)
            if room_m > most_m:
                best, most_m = way, room_m
    return best


def _least_room(
    problem: Problem,
    runs: Sequence[Integrator],
    state: NDArray[np.float64],
    timeline: Timeline,
    worth_m: float = -math.inf,
) -> float:
    """Return the smallest clearance (m) with several models; given up where one leaves under `worth_m`."""
    least_m = math.inf
    for run in runs:
        least_m = min(least_m, room_of(problem, run, state, timeline))
        if least_m <= worth_m:
            break
    return least_m


def room_of(problem: Problem, run: Integrator, state: NDArray[np.float64], timeline: Timeline) -> float:
    """Return the smallest clearance (m) of a model's body over a timeline."""
    try:
        trajectory = run.run(timeline, state)
    except NoAnswerError:
        return -math.inf
    watch = BodyWatch(problem, problem.robot, run)
    watch.look(trajectory.time_s, trajectory.pose, trajectory.kappa, ends=False)
    return watch.smallest_m

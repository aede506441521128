"""Coming to rest: vent at once, or brake with another gait for a cycle first, whatever leaves more room.

A vented body straightens while it rolls on, and near a wall that may be the one thing that touches it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planners.drive.contact import BodyWatch
from planners.search.problem import Problem
from srs_opt.errors import NoAnswerError
from srs_opt.simulate.timeline import Timeline

COAST_S = 1.5  # watched after the valves have been vented
ENOUGH_MARGINS = 0.5  # of the margin: venting at once is good enough where the model keeps so much


def halt(problem: Problem, state: NDArray[np.float64]) -> Timeline:
    """Return the valves' timeline that brings the planned robot to rest farthest from the walls.

    Parameters
    ----------
    problem : Problem
    state : array
        Of the planned robot's model; forward speed in entry 3.
    """
    vent = Timeline.vent(problem.robot.segments, COAST_S, 0.0)
    best, most_m = vent, room_of(problem, state, vent)
    if most_m >= ENOUGH_MARGINS * problem.margin_m:
        return vent
    for entry in problem.gaits.gaits:
        if entry.speed_m_s * float(state[3]) > 0:
            continue
        brake = Timeline.join([Timeline.of_gait(entry.gait, entry.gait.period_s), vent])
        room_m = room_of(problem, state, brake)
        if room_m > most_m:
            best, most_m = brake, room_m
    return best


def room_of(problem: Problem, state: NDArray[np.float64], timeline: Timeline) -> float:
    """Return the smallest clearance (m) of the planned robot's body over a timeline."""
    try:
        trajectory = problem.run.run(timeline, state)
    except NoAnswerError:
        return -np.inf
    watch = BodyWatch(problem, problem.robot, problem.run)
    watch.look(trajectory.time_s, trajectory.pose, trajectory.kappa, ends=False)
    return watch.smallest_m

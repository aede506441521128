"""What is still to come: the estimated price from where a cycle ends to the goal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planners.motion.table import body_in_room
from planners.search.costmap import BLOCKED_S
from planners.search.problem import Problem

Array = NDArray[np.float64]
OFF_THE_WAY_S = 1.0  # for a head in a place that leads nowhere


def remaining(problem: Problem, end: Array, speed_m_s: Array) -> Array:
    """Return the estimated price of what is left from the ends of a cycle of every gait.

    Parameters
    ----------
    problem : Problem
    end : array (gaits, 3)
        Poses; the price is that of the way from the middle, from ahead of it and from the head, in the mean.
    speed_m_s : array (gaits,)
        Forward speeds there: speed is dear, it takes seconds to gather.
    """
    course = end[:, 2] + problem.motion.course[:-1]
    lever = problem.robot.length_m / 2
    along = lever * np.stack([np.cos(course), np.sin(course)], axis=1)
    where = end[:, :2]
    middle, head, front = problem.to_goal.at(np.stack([where, where + along, where + 0.5 * along]))
    head = np.where(head < BLOCKED_S, head, middle + OFF_THE_WAY_S)
    front = np.where(front < BLOCKED_S, front, middle + 0.5 * OFF_THE_WAY_S)
    left = (middle + head + front) / 3
    lack = np.clip(1 - np.abs(speed_m_s) / problem.tariff.top_speed_m_s, 0.0, 1.0)
    left = left + problem.tariff.start_up * lack * np.minimum(left, 1.0)
    return np.where(middle < BLOCKED_S, left, BLOCKED_S)


def motion_lines(problem: Problem, before: int, pose: Array, gaits: NDArray[np.int64] | slice) -> Array:
    """Return thinned centre lines (gaits, samples, points, 2) of a cycle of some gaits after another."""
    body = problem.motion.body[before, gaits, 2::2, ::4]
    return body_in_room(body, pose[gaits, 2::2])

"""The search's heuristic: the estimated cost to go from the end of a cycle to the goal."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planners.search.costmap import BLOCKED_S
from planners.search.problem import Problem
from planners.search.settings import HEURISTIC
from srs_opt.geometry import points_in_room

Array = NDArray[np.float64]


def cost_to_go(problem: Problem, end: Array, speed_m_s: Array, by_heading: bool = False) -> Array:
    """Return the estimated cost of what is left from the ends of a cycle of every gait.

    Parameters
    ----------
    problem : Problem
    end : array (..., gaits, 3)
        Poses; the cost is the mean of the ways from the middle, from half-way to the head and, twice, from
        the head: it is the first to know that a cycle turns the right way.
    speed_m_s : array (..., gaits)
        Forward speeds there. Accelerating takes several cycles, so slow states get a start-up cost.
    by_heading : bool
        Estimate by place, course and direction of travel (`heading_map`) instead of by place alone.
    """
    if by_heading:
        left, middle = _by_heading(problem, end)
    else:
        left, middle = _by_place(problem, end)
    lack = np.clip(1 - np.abs(speed_m_s) / problem.cost_model.top_speed_m_s, 0.0, 1.0)
    left = left + problem.cost_model.start_up * lack * np.minimum(left, 1.0)
    return np.where(middle < BLOCKED_S, left, BLOCKED_S)


def _by_heading(problem: Problem, end: Array) -> tuple[Array, Array]:
    """Return the cost of what is left, and whether there is a way at all (by place)."""
    course = end[..., 2] + problem.motion.course[:-1]
    middle = problem.to_goal.at(end[..., :2])
    left = problem.to_goal_by_heading.at(end[..., :2], course, problem.motion.steady_speed_m_s < 0)
    return np.where(left < BLOCKED_S, left, middle + HEURISTIC.dead_end_s), middle


def _by_place(problem: Problem, end: Array) -> tuple[Array, Array]:
    """Return the cost of what is left, and whether there is a way at all."""
    course = end[..., 2] + problem.motion.course[:-1]
    lever = problem.robot.length_m / 2
    along = lever * np.stack([np.cos(course), np.sin(course)], axis=-1)
    where = end[..., :2]
    middle, head, front = problem.to_goal.at(np.stack([where, where + along, where + 0.5 * along]))
    head = np.where(head < BLOCKED_S, head, middle + HEURISTIC.dead_end_s)
    front = np.where(front < BLOCKED_S, front, middle + 0.5 * HEURISTIC.dead_end_s)
    # a point that is nearer to the goal by more than the way to it takes lies behind a wall
    gain = HEURISTIC.most_gain * lever / problem.cost_model.top_speed_m_s
    head, front = np.maximum(head, middle - gain), np.maximum(front, middle - 0.5 * gain)
    return (middle + 2 * head + front) / 4, middle


def motion_lines(
    problem: Problem, before: int | NDArray[np.int64], pose: Array, gaits: NDArray[np.int64]
) -> Array:
    """Return thinned centre lines (n, samples, points, 2) of cycles of gaits (n,) after another or others.

    `pose` (n, SAMPLES + 1, 3) is over these cycles.
    """
    return points_in_room(problem.motion.body[problem.motion.row_of[before], gaits, 2::2, ::4], pose[:, 2::2])

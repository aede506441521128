"""A geometric path turned into gaits: the dynamic model follows it, a gait chosen for every cycle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planners.search.costmap import speed_by_room
from planners.search.problem import Problem
from planners.search.settings import FOLLOW
from planners.search.track import Learned, Reference, Where, choose, nearest_node
from planners.search.tree import Step, arrival_index, at_rest
from srs_opt.model.state import FORWARD, POSE

Array = NDArray[np.float64]


def reference_along(problem: Problem, path: Array) -> Reference:
    """Return the reference for a path of poses (n, 3): as fast as the room lets, backing up where it does."""
    steps = np.diff(path[:, :2], axis=0)
    far = np.hypot(*steps.T)
    keep = np.append(far > 1e-9, True)
    path = path[keep]
    steps, far = np.diff(path[:, :2], axis=0), np.hypot(*np.diff(path[:, :2], axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(far)])
    at = np.linspace(0.0, along[-1], max(2, int(along[-1] / (FOLLOW.spacing * problem.robot.length_m))))
    heading = np.interp(at, along, np.unwrap(path[:, 2]))
    x, y = np.interp(at, along, path[:, 0]), np.interp(at, along, path[:, 1])
    forward = np.cos(path[:-1, 2]) * steps[:, 0] + np.sin(path[:-1, 2]) * steps[:, 1] >= 0
    sign = np.where(forward, 1.0, -1.0)[np.searchsorted(along[1:-1], at)]
    reach, best = speed_by_room(problem.gaits)
    room = problem.field.clearance(np.stack([x, y], axis=1)) - problem.margin_m
    speed = best[np.clip(np.searchsorted(reach, room, side="right") - 1, 0, None)]
    left = np.concatenate([np.cumsum((np.diff(at) / speed[1:])[::-1])[::-1], [0.0]])
    return Reference(np.stack([x, y, heading], axis=1), sign * speed, left, np.zeros(0, np.int64))


def follow(problem: Problem, reference: Reference) -> list[Step] | None:
    """Return the cycles with which the model follows a reference to the goal, or None if it does not."""
    root = at_rest(problem)
    state, gait, node = root.state, root.gait, 0
    steps: list[Step] = []
    for _ in range(10 + int(FOLLOW.patience * reference.left_s[0] / FOLLOW.cycle_s)):
        where = Where(state[POSE], gait, float(state[FORWARD]))
        choice = choose(problem, reference, where, Learned(), node)
        cycle = problem.simulate(state, gait, choice.gait)
        slack = cycle.tube_m if steps else problem.start_slack_m
        if not problem.body.keeps_margin(cycle.lines, slack):
            return None
        steps.append(Step(choice.gait, cycle))
        if arrival_index(problem.goal, cycle.pose) is not None:
            return steps
        state, gait = cycle.state, choice.gait
        node = nearest_node(reference, state[POSE], node)
    return None

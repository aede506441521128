"""What the searches over cycles share: where they begin, the tree of what was simulated, cells of states."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planners.maze.places import Goal
from planners.search.problem import Cycle, Problem
from srs_opt.model.state import FORWARD, X, Y

Array = NDArray[np.float64]


class Root(NamedTuple):
    """Where a search begins: state of the dynamic model, gait before (or rest), slack of the first cycle."""

    state: Array
    gait: int
    slack_m: float


def at_rest(problem: Problem) -> Root:
    """Return the straight robot at rest at the start."""
    start = problem.start
    state = problem.integrator.rest(start.x, start.y, start.heading)
    return Root(state, problem.motion.rest, problem.start_slack_m)


class Step(NamedTuple):
    """A node on the way: the gait that led here and what happened in its cycle."""

    gait: int
    cycle: Cycle


@dataclass
class Tree:
    """What was simulated: every node's parent, gait, cost up to there, and cycle."""

    parent: list[int] = field(default_factory=list)
    gait: list[int] = field(default_factory=list)
    spent: list[float] = field(default_factory=list)
    cycle: list[Cycle] = field(default_factory=list)

    def add(self, parent: int, gait: int, spent: float, cycle: Cycle) -> int:
        """Add a node and return its number."""
        self.parent.append(parent)
        self.gait.append(gait)
        self.spent.append(spent)
        self.cycle.append(cycle)
        return len(self.parent) - 1

    def way_to(self, node: int) -> list[Step]:
        """Return the steps from the root to a node."""
        steps = []
        while self.parent[node] >= 0:
            steps.append(Step(self.gait[node], self.cycle[node]))
            node = self.parent[node]
        return steps[::-1]


def cell_of(
    state: Array, course_rad: float, cell_m: float, cell_rad: float, cell_m_s: float
) -> tuple[int, int, int, int]:
    """Return the cell of place, course and forward speed that a state lies in."""
    return (
        math.floor(state[X] / cell_m),
        math.floor(state[Y] / cell_m),
        math.floor(course_rad % (2 * math.pi) / cell_rad),
        math.floor(state[FORWARD] / cell_m_s + 0.5),
    )


def arrival_index(goal: Goal, pose: Array) -> int | None:
    """Return the first of the poses (n, 3) that is in the goal, heading included; None if none is."""
    inside = np.flatnonzero(goal.distance(pose[:, :2]) <= 0)
    for index in inside:
        if goal.heading_error(float(pose[index, 2])) <= 0:
            return int(index)
    return None

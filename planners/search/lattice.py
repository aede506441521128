"""Best-first search over cycles of gaits (Hybrid A* with the dynamic model inside).

A node is the state of the dynamic model at the end of a cycle. The motion table proposes where every gait
would lead and sorts out what cannot be; only the node that the search goes on from is simulated, so the
tree consists of true motions, transients included. Nodes are told apart by cells of place, course and
speed: what is left when none remains is a proof at that resolution.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import numpy as np

from planners.search.costmap import BLOCKED_S
from planners.search.heuristic import cost_to_go, motion_lines
from planners.search.problem import Cycle, Problem
from planners.search.tree import Root, Step, Tree, arrival_index, at_rest, cell_of
from srs_opt.model.state import FORWARD, HEADING, X, Y


@dataclass(frozen=True)
class LatticeSettings:
    """Resolution and greed; lengths in body lengths, speeds in body lengths per second.

    Attributes
    ----------
    cell, course_rad, speed : float
        Cells by which nodes are told apart.
    close, most_halvings : float, int
        A body nearer to a wall than this is told apart more finely: half the cell for every halving of its
        clearance, so many times at most.
    greed : float
        Weight of the remaining time against the time spent: 1 looks for fast plans, more finds one sooner.
    change_s : float
        Cost of changing gait.
    air_s : float
        Cost of a cycle that just keeps the margin (none where a body width of air is left).
    slack : float
        Beyond the margin, for what happens between the samples of a cycle.
    by_heading : bool
        Estimate what is left by place, course and direction of travel.
    """

    cell: float = 0.0847
    course_rad: float = math.radians(12)
    speed: float = 0.508
    close: float = 0.0847
    most_halvings: int = 0
    greed: float = 3.0
    change_s: float = 0.05
    air_s: float = 0.3
    slack: float = 0.00212
    by_heading: bool = False


LATTICE = LatticeSettings()


class LatticeSearch:
    """A search that can be asked for the next plan until nothing is left."""

    def __init__(
        self, problem: Problem, settings: LatticeSettings | None = None, root: Root | None = None
    ) -> None:
        root = root or at_rest(problem)
        self.problem = problem
        self.root_slack_m = root.slack_m
        self.settings = settings or LATTICE
        self.expanded = 0
        self.simulated = 0
        self._tree = Tree()
        self._closed: set[tuple[int, ...]] = set()
        self._open: list[tuple[float, int, int, int, float]] = []
        self._count = 0
        motion = problem.motion
        first = Cycle(root.state, root.state[None, :3], np.zeros((0, 1, 2)))
        self._gaits = np.arange(motion.size)
        self._propose(self._tree.add(-1, root.gait, 0.0, first))

    def advance(self, expansions: int) -> list[Step] | None:
        """Look at up to `expansions` more nodes; return the way to the goal when one is found."""
        for _ in range(expansions):
            if not self._open:
                return None
            node = self._take()
            if node is None:
                continue
            cycle = self._tree.cycle[node]
            if arrival_index(self.problem.goal, cycle.pose) is not None:
                return self._tree.way_to(node)
            self._propose(node)
        return None

    @property
    def in_doubt(self) -> bool:
        """Always: this search looks where a beam has failed."""
        return True

    @property
    def exhausted(self) -> bool:
        """Whether nothing is left to look at: no way at this resolution."""
        return not self._open

    def _take(self) -> int | None:
        """Simulate the most promising proposal; return its node if it is new and clear."""
        _, _, parent, gait, spent = heapq.heappop(self._open)
        self.simulated += 1
        cycle = self.problem.simulate(self._tree.cycle[parent].state, self._tree.gait[parent], gait)
        key = self._key(cycle, gait)
        if key in self._closed:
            return None
        # the start may be as near to a wall as it likes; no cycle may bring the body nearer than that
        slack = self.root_slack_m if parent == 0 else self.settings.slack * self.problem.robot.length_m
        if not self.problem.body.keeps_margin(cycle.lines, slack + (cycle.tube_m if parent else 0.0)):
            return None
        self._closed.add(key)
        return self._tree.add(parent, gait, spent, cycle)

    def _key(self, cycle: Cycle, gait: int) -> tuple[int, ...]:
        """Return the cell of a state; with halvings, cells are smaller near walls: a millimetre decides."""
        s, state, length = self.settings, cycle.state, self.problem.robot.length_m
        finer = 0
        if s.most_halvings:
            room = float(self.problem.body.estimate(cycle.lines[::2]).min())
            halvings = math.log2(s.close * length / max(room, s.close * length / 2**s.most_halvings))
            finer = max(math.ceil(halvings), 0)
        course = state[HEADING] + self.problem.motion.course[gait]
        return finer, *cell_of(
            state, course, s.cell * length / 2**finer, s.course_rad / 2**finer, s.speed * length
        )

    def _propose(self, node: int) -> None:
        """Put the cycles that can follow a node on the list."""
        self.expanded += 1
        problem, s, motion = self.problem, self.settings, self.problem.motion
        state, before = self._tree.cycle[node].state, self._tree.gait[node]
        move = motion.move(state[X], state[Y], state[HEADING], before, state[FORWARD])
        # every other point and sample decides what is out of the question; the simulation decides the rest
        lines = motion_lines(problem, before, move.pose[self._gaits], self._gaits)
        room = problem.body.estimate(lines).min(axis=1)
        left = cost_to_go(problem, move.pose[:, -1], move.speed_m_s, s.by_heading)
        possible = (room > problem.margin_m - problem.field.error_m) & (left < BLOCKED_S / 2)
        possible &= motion.may_follow(before)
        air = np.clip(1 - (room - problem.margin_m) / problem.motion.body_width_m, 0.0, 1.0)
        cost = problem.cost_model.of_cycles(self._gaits, move.pose, room - problem.margin_m)
        spent = self._tree.spent[node] + cost
        spent = spent + s.change_s * (self._gaits != before) + s.air_s * air
        rank = spent + s.greed * left
        for gait in np.flatnonzero(possible):
            self._count += 1
            heapq.heappush(self._open, (float(rank[gait]), self._count, node, int(gait), float(spent[gait])))

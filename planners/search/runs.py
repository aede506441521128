"""Best-first search over runs of one gait, for ways that leave a motion little room.

A corridor that fits a motion fits few others, and what passes it changes gait seldom: every change costs a
transient and a ramp of pressure. So a gait goes on for as long as the body keeps the margin, and the states
on that run are then left for other gaits, first where the most way lies behind for the fewest changes. The
map of costs to go decides little, since in such corridors it leads to where no body can turn. Regions that
were looked at often wait: else the states of one dead end take all the time.

A proposal whose end, by the motion table, lies in a cell that is taken is not simulated, and the margin is
judged by a table of distances as fine as the maze allows: of ten cycles that a coarse table lets pass, nine
touch.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planners.search.costmap import BLOCKED_S
from planners.search.heuristic import motion_lines
from planners.search.problem import Cycle, Problem
from planners.search.tree import Root, Step, Tree, arrival_index, at_rest, cell_of
from srs_opt.model.state import FORWARD, HEADING, PLACE, X, Y


@dataclass(frozen=True)
class RunSettings:
    """Order and resolution; lengths in body lengths, speeds in body lengths per second.

    Attributes
    ----------
    cell, course_rad, speed : float
        Cells of the duplicate test, by gait: the first state in a cell is kept. Double merges ways that
        differ by a few millimetres, of which one goes on and the other does not; half takes two to four times
        the cycles.
    region, region_rad : float
        Cells of place and course that are looked at equally often.
    way_per_change : float
        Way that makes up for a change of gait. Shorter: the deepest run is followed first.
    crowd : float
        Changes of gait that a look into a region counts for. Smaller: dead ends are looked into for longer;
        larger: all regions are looked at alike, however they are reached.
    left_per_s : float
        Changes of gait that a second of what is left to go counts for.
    slack : float
        Beyond the margin, for what happens between the samples of a cycle.
    table_error : float
        By how much the motion table may have a body nearer to a wall than the simulation; at changes of gait
        it is up to 16 mrad off. Half misses ways with a millimetre to spare.
    batch : int
        Cycles simulated side by side. Larger simulates some in vain, smaller takes more time for each.
    """

    cell: float = 0.0106
    course_rad: float = 0.015
    speed: float = 0.2
    region: float = 0.2
    region_rad: float = math.radians(30)
    way_per_change: float = 1.5
    crowd: float = 0.05
    left_per_s: float = 0.3
    slack: float = 0.000424
    table_error: float = 0.0106
    batch: int = 16


RUNS = RunSettings()
_Key = tuple[int, ...]


class _Proposal(NamedTuple):
    """A cycle that may be begun: rank when put on the list, rank by its way alone, parent, gait, cells."""

    rank: float
    number: int
    own: float
    parent: int
    gait: int
    region: _Key
    cell: _Key


class RunSearch:
    """A search over runs of one gait, advanced until it arrives or has nothing left."""

    def __init__(
        self, problem: Problem, settings: RunSettings | None = None, root: Root | None = None
    ) -> None:
        root = root or at_rest(problem)
        self.problem, self.settings = problem.finer, settings or RUNS
        self.root_slack_m = root.slack_m
        self.expanded = self.simulated = 0
        self._tree = Tree()
        self._way_m, self._changes = [0.0], [0]
        self._open: list[_Proposal] = []
        self._closed: set[_Key] = set()
        self._looks: dict[_Key, int] = {}
        self._count = 0
        first = Cycle(root.state, root.state[None, :3], np.zeros((0, 1, 2)))
        self._propose([self._tree.add(-1, root.gait, 0.0, first)])

    @property
    def exhausted(self) -> bool:
        """Whether nothing is left to look at (no proof of anything)."""
        return not self._open

    @property
    def in_doubt(self) -> bool:
        """Always: this search looks where others have failed."""
        return True

    def advance(self, expansions: int) -> list[Step] | None:
        """Look at about `expansions` more states; return the way to the goal when one is found."""
        last = self.expanded + expansions
        while self._open and self.expanded < last:
            batch = self._batch()
            begins = [(self._tree.cycle[p.parent].state, self._tree.gait[p.parent], p.gait) for p in batch]
            self.simulated += len(batch)
            fresh = []
            for proposal, cycle in zip(batch, self.problem.simulate_all(begins)):
                node = None if cycle is None else self._taken(proposal, cycle)
                if node is None:
                    continue
                if arrival_index(self.problem.goal, self._tree.cycle[node].pose) is not None:
                    return self._tree.way_to(node)
                fresh.append(node)
            if fresh:
                self._propose(fresh)
        return None

    def _batch(self) -> list[_Proposal]:
        """Return the most promising proposals; a region's looks since count against its own."""
        batch: list[_Proposal] = []
        cells: set[_Key] = set()
        while self._open and len(batch) < self.settings.batch:
            proposal = heapq.heappop(self._open)
            if proposal.cell in self._closed or proposal.cell in cells:
                continue
            looks = self._looks.get(proposal.region, 0)
            rank = proposal.own + self.settings.crowd * looks
            if rank > proposal.rank:
                heapq.heappush(self._open, proposal._replace(rank=rank))
                continue
            self._looks[proposal.region] = looks + 1
            cells.add(proposal.cell)
            batch.append(proposal)
        return batch

    def _taken(self, proposal: _Proposal, cycle: Cycle) -> int | None:
        """Keep a simulated cycle if it is clear and the first to end in its cell."""
        state, parent, gait = cycle.state, proposal.parent, proposal.gait
        course = state[HEADING] + self.problem.motion.course[gait]
        _, cell = self._cells(state[X], state[Y], course, state[FORWARD], gait)
        if cell in self._closed:
            return None
        slack = self.root_slack_m if parent == 0 else self.settings.slack * self.problem.robot.length_m
        if not self.problem.body.keeps_margin(cycle.lines, slack + (cycle.tube_m if parent else 0.0)):
            return None
        self._closed.add(cell)
        far = float(np.hypot(*(state[PLACE] - self._tree.cycle[parent].state[PLACE])))
        self._way_m.append(self._way_m[parent] + far)
        self._changes.append(self._changes[parent] + (self._tree.gait[parent] != gait))
        return self._tree.add(parent, gait, 0.0, cycle)

    def _cells(self, x: float, y: float, course: float, speed: float, gait: int) -> tuple[_Key, _Key]:
        """Return the region and the cell that a state lies in."""
        s, length = self.settings, self.problem.robot.length_m
        state = np.zeros(FORWARD + 1)
        state[X], state[Y], state[FORWARD] = x, y, speed
        return (
            cell_of(state, course, s.region * length, s.region_rad, length),
            (gait, *cell_of(state, course, s.cell * length, s.course_rad, s.speed * length)),
        )

    def _propose(self, nodes: list[int]) -> None:
        """Put the cycles that can follow some states on the list; the same gait goes on at once."""
        self.expanded += len(nodes)
        problem, s, motion, tree = self.problem, self.settings, self.problem.motion, self._tree
        states = np.array([tree.cycle[node].state[: FORWARD + 1] for node in nodes])
        begin, speeds = states[:, [X, Y, HEADING]], states[:, FORWARD]
        before = np.array([tree.gait[node] for node in nodes])
        end, speed = motion.ends(begin, before, speeds)
        # of a bent body the centre of mass may be where the map has a wall: the body decides, not the map
        left = problem.to_goal.at(end[..., :2])
        straight = problem.goal.distance(end[..., :2]) / problem.cost_model.top_speed_m_s
        left = np.where(left < BLOCKED_S / 2, left, straight)
        owner, now = np.nonzero([motion.may_follow(int(gait)) for gait in before])
        if not owner.size:
            return
        earlier = before[owner]
        pose = motion.poses(begin[owner], earlier, speeds[owner], now)
        lines = motion_lines(problem, earlier, pose, now)
        spare = problem.body.estimate(lines).min(axis=1) - problem.margin_m
        unsure = problem.field.error_m + s.table_error * problem.robot.length_m
        for k in np.flatnonzero(spare > -unsure):
            node, gait, last = nodes[owner[k]], int(now[k]), end[owner[k], now[k]]
            own = -math.inf
            if gait != earlier[k]:
                way = self._way_m[node] / (s.way_per_change * problem.robot.length_m)
                own = self._changes[node] - way + s.left_per_s * float(left[owner[k], now[k]])
            course = float(last[2]) + float(motion.course[gait])
            now_m_s = float(speed[owner[k], gait])
            region, cell = self._cells(float(last[0]), float(last[1]), course, now_m_s, gait)
            self._count += 1
            rank = own + s.crowd * self._looks.get(region, 0)
            heapq.heappush(self._open, _Proposal(rank, self._count, own, node, gait, region, cell))

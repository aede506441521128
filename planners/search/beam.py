"""Beam search over cycles of gaits: the best few states of every cycle go on, all simulated together.

Not complete, but its plans are faster than those that the best-first search finds as soon: states after
the same number of cycles are compared by the time that they have taken and the time that they need, so
nothing has to be greedy. Where no state of the beam can go on, the best-first search takes over.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planners.motion.table import SAMPLES
from planners.search.costmap import BLOCKED_S
from planners.search.heuristic import cost_to_go, motion_lines
from planners.search.problem import Cycle, Problem
from planners.search.tree import Root, Step, Tree, arrival_index, at_rest, cell_of
from srs_opt.model.state import FORWARD, HEADING, PLACE, X, Y

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BeamSettings:
    """Width and resolution; lengths in body lengths, speeds in body lengths per second.

    Attributes
    ----------
    width : int, optional
        States kept per level; by default few on a long way and more on a short one.
    least_width, most_width, width_times_s : int, int, float
        Bounds of that, and width times seconds to go. Wider finds faster plans in as much more time.
    branching : int
        Most successors kept of one state.
    cell, course_rad, speed : float
        Cells of the duplicate test: of two states in one cell the cheaper is kept.
    change_s : float
        Cost of changing gait.
    air_s : float
        Cost of a cycle that just keeps the margin (none where a body width of air is left).
    slack : float
        Beyond the margin, for what happens between the samples of a cycle.
    by_heading : bool
        Estimate what is left by place, course and direction of travel.
    first_look : int
        Gaits whose bodies are looked at first, most promising first; the others only where too few fit.
    batch : int
        Cycles simulated side by side. Larger simulates some in vain, smaller takes more time for each.
    doubted, given_up : int
        Cycles without progress towards the goal after which the beam is in doubt, and ended. Fewer end
        beams that have to go round a wall, more hold up the search that comes next.
    """

    width: int | None = None
    least_width: int = 12
    most_width: int = 32
    width_times_s: float = 200.0
    branching: int = 4
    cell: float = 0.127
    course_rad: float = math.radians(15)
    speed: float = 0.424
    change_s: float = 0.02
    air_s: float = 0.07
    slack: float = 0.00212
    by_heading: bool = False
    first_look: int = 32
    batch: int = 8
    doubted: int = 3
    given_up: int = 10


BEAM = BeamSettings()


class _Expansion(NamedTuple):
    """A cycle that may be begun: rank, parent and gait, cost up to its end."""

    rank: float
    parent: int
    gait: int
    spent: float


class _Begins(NamedTuple):
    """States that cycles begin from: node, pose (n, 3), gait before and forward speed of each."""

    node: list[int]
    pose: Array
    before: NDArray[np.int64]
    speed_m_s: Array


class BeamSearch:
    """A beam search, advanced until it arrives or has no state left."""

    def __init__(
        self, problem: Problem, settings: BeamSettings | None = None, root: Root | None = None
    ) -> None:
        root = root or at_rest(problem)
        self.problem, self.settings = problem, settings or BEAM
        self.root_slack_m = root.slack_m
        self.expanded = self.simulated = 0
        first = Cycle(root.state, root.state[None, :3], np.zeros((0, 1, 2)))
        self._tree = Tree()
        self._front = [self._tree.add(-1, root.gait, 0.0, first)]
        self._cheapest: dict[tuple[int, ...], float] = {}
        self._best: tuple[float, int] | None = None
        self._nearest, self._stalled = math.inf, 0
        to_go_s = self._to_go_s(self._front) + 0.1
        s = self.settings
        self._width = s.width or round(min(max(s.width_times_s / to_go_s, s.least_width), s.most_width))

    @property
    def exhausted(self) -> bool:
        """Whether the beam has ended (no proof of anything)."""
        return not self._front

    @property
    def in_doubt(self) -> bool:
        """Whether the goal has not come nearer for some cycles."""
        return self._stalled >= self.settings.doubted

    def advance(self, expansions: int) -> list[Step] | None:
        """Advance the beam by about `expansions` states; return the way to the goal when it has ended."""
        last = self.expanded + expansions
        while self._front and self.expanded < last:
            self._front = self._chosen(sorted(self._expansions(self._front)))
            nearest = self._to_go_s(self._front)
            self._stalled = 0 if nearest < self._nearest else self._stalled + 1
            self._nearest = min(nearest, self._nearest)
            if self._stalled == self.settings.given_up:
                self._front = []
        if self._front or self._best is None:
            return None
        return self._tree.way_to(self._best[1])

    def _to_go_s(self, nodes: list[int]) -> float:
        """Return the least cost to the goal from the centres of mass of some nodes."""
        if not nodes:
            return math.inf
        places = np.array([self._tree.cycle[node].state[PLACE] for node in nodes])
        return float(self.problem.to_goal.at(places).min())

    def _expansions(self, nodes: list[int]) -> list[_Expansion]:
        """Return the cycles that may follow some states, by the motion table."""
        self.expanded += len(nodes)
        problem, s, motion, tree = self.problem, self.settings, self.problem.motion, self._tree
        begin = _Begins(
            nodes,
            np.array([tree.cycle[node].state[[X, Y, HEADING]] for node in nodes]),
            np.array([tree.gait[node] for node in nodes]),
            np.array([tree.cycle[node].state[FORWARD] for node in nodes]),
        )
        end, speed_m_s = motion.ends(begin.pose, begin.before, begin.speed_m_s)
        left = cost_to_go(problem, end, speed_m_s, s.by_heading)
        orders = []
        for mine, before in zip(left, begin.before.tolist()):
            order = np.argsort(mine + motion.period_s, kind="stable")
            orders.append(order[(mine[order] < BLOCKED_S / 2) & motion.may_follow(before)[order]])
        found = self._fitting(
            begin, list(range(len(nodes))), [order[: s.first_look] for order in orders], left
        )
        few = [k for k, mine in enumerate(found) if len(mine) < s.branching]
        more = self._fitting(begin, few, [orders[k][s.first_look :] for k in few], left)
        return [expansion for mine in (*found, *more) for expansion in mine]

    def _fitting(
        self, begin: _Begins, which: list[int], gaits: list[NDArray[np.int64]], left: Array
    ) -> list[list[_Expansion]]:
        """Return for some of the states, and gaits of each, the cycles whose bodies are not in a wall."""
        found: list[list[_Expansion]] = [[] for _ in which]
        if not sum(map(len, gaits)):
            return found
        problem, s, motion = self.problem, self.settings, self.problem.motion
        owner = np.repeat(np.arange(len(which)), [len(mine) for mine in gaits])
        state, now = np.array(which)[owner], np.concatenate(gaits)
        before = begin.before[state]
        pose = motion.poses(begin.pose[state], before, begin.speed_m_s[state], now)
        spare = problem.body.estimate(motion_lines(problem, before, pose, now)).min(axis=1) - problem.margin_m
        tight = np.clip(1 - spare / motion.body_width_m, 0.0, 1.0)
        spent = np.array([self._tree.spent[begin.node[k]] for k in which])[owner]
        spent = spent + problem.cost_model.of_cycles(now, pose, spare)
        spent = spent + s.change_s * (now != before) + s.air_s * tight
        rank = spent + left[state, now]
        clear = np.flatnonzero(spare > -problem.field.error_m)
        columns = (a[clear].tolist() for a in (owner, rank, state, now, spent))
        for mine, r, k, gait, cost in zip(*columns):
            found[mine].append(_Expansion(r, begin.node[k], gait, cost))
        return found

    def _chosen(self, expansions: list[_Expansion]) -> list[int]:
        """Simulate expansions, best first, until the front is full again."""
        s, front = self.settings, []
        taken: dict[int, int] = {}
        for first in range(0, len(expansions), s.batch):
            some = expansions[first : first + s.batch]
            batch = [o for o in some if taken.get(o.parent, 0) < s.branching]
            if self._best is not None:
                batch = [o for o in batch if o.rank < self._best[0]]
                if not batch:
                    break
            self.simulated += len(batch)
            tree = self._tree
            begins = [(tree.cycle[o.parent].state, tree.gait[o.parent], o.gait) for o in batch]
            done = [
                (expansion, cycle)
                for expansion, cycle in zip(batch, self.problem.simulate_all(begins))
                if cycle is not None
            ]
            if not done:
                continue
            rooms = self.problem.body.estimate(np.stack([cycle.lines for _, cycle in done]))
            for (expansion, cycle), room in zip(done, rooms):
                node = self._taken(expansion, cycle, room)
                if node is not None:
                    taken[expansion.parent] = taken.get(expansion.parent, 0) + 1
                    front.append(node)
            if len(front) >= self._width:
                break
        return front[: self._width]

    def _taken(self, expansion: _Expansion, cycle: Cycle, room: Array) -> int | None:
        """Keep a simulated cycle if it is clear and the cheapest to come here; None too where it arrives.

        `room` (SAMPLES + 1,) is the estimated clearance of its bodies.
        """
        s, state, length = self.settings, cycle.state, self.problem.robot.length_m
        course = state[HEADING] + self.problem.motion.course[expansion.gait]
        key = cell_of(state, course, s.cell * length, s.course_rad, s.speed * length)
        if self._cheapest.get(key, math.inf) <= expansion.spent:
            return None
        slack = self.root_slack_m if expansion.parent == 0 else s.slack * length
        slack += cycle.tube_m if expansion.parent else 0.0
        if not self.problem.body.keeps_margin(cycle.lines, slack, room):
            return None
        self._cheapest[key] = expansion.spent
        node = self._tree.add(expansion.parent, expansion.gait, expansion.spent, cycle)
        arrived = arrival_index(self.problem.goal, cycle.pose)
        if arrived is None:
            return node
        before = self._tree.spent[expansion.parent]
        cost = before + (expansion.spent - before) * arrived / SAMPLES
        if self._best is None or cost < self._best[0]:
            self._best = cost, node
        return None

"""The certificate: the whole plan played on the dynamic model, afresh and finer, against exact geometry.

Nothing of the search is used but the order of its gaits: the model is integrated adaptively from rest, and
at every node of that integration the body's capsules are measured against the walls themselves.

The integration's own error is bounded and taken off. The plan is integrated with two tolerances, a factor
apart, and with ramps of pressure whose error is as much apart; the finer integration errs fifteen to a
hundred times less, so that a third of the distance between the two bounds its error with room to spare
(Richardson). The largest distance so far counts, since an error may pass through zero. A heading that is off
moves the body by its lever arm, and so the bound grows with the way as the error does. Where it is above a
tenth of the clearance the tolerance is tightened.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from planners.plan.settings import PLAN_CERTIFICATE
from planners.search.problem import ROUNDING_M, Problem
from planners.search.tree import Root, arrival_index, at_rest
from srs_opt.errors import NoAnswerError
from srs_opt.geometry import points_in_room
from srs_opt.model.outline import POINTS_PER_ARC
from srs_opt.simulate.batched import Search, run_batched
from srs_opt.simulate.integrate import Trajectory
from srs_opt.simulate.interpolate import linear
from srs_opt.simulate.shapes import centre_lines

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Certificate:
    """What the fresh simulation found.

    Attributes
    ----------
    passed : bool
    reason : str
        Why not; empty when passed.
    clearance_m : float
        The body keeps at least this distance from the walls on the way; `error_m` is taken off.
    error_m : float
        Bound on how far any point of the body is from where an exact integration would have it.
    between_m : float
        No part of the body comes nearer than this between the instants looked at either (at least 0 is
        asked for): the clearance less half of what any point moves meanwhile and the arcs' sagitta.
    failed_cycle : int or None
        Index of the first cycle that fails.
    time_s : array (n,)
        Instants, up to arrival.
    pose : array (n, 3)
    lines : array (n, points, 2)
        Centre line of the body in the room.
    room_m : array (n,)
        Clearance at those instants, the error taken off (see `clearances`: large ones are lower bounds).
    cycle : int array (n,)
        Index of the cycle that each instant belongs to.
    states : tuple of arrays
        State of the model at the end of every cycle.
    """

    passed: bool
    reason: str
    clearance_m: float
    error_m: float
    between_m: float
    failed_cycle: int | None
    time_s: Array
    pose: Array
    lines: Array
    room_m: Array
    cycle: NDArray[np.int64]
    states: tuple[Array, ...]


def certify(problem: Problem, gaits: Sequence[int], root: Root | None = None) -> Certificate:
    """Play a sequence of gaits, a cycle each, from the start (or another root) and judge it."""
    return Certifier(problem, root).certify(gaits)


class Certifier:
    """Certifies sequences of gaits from one root; what they begin with in common is integrated once.

    Parameters
    ----------
    problem : Problem
    root : Root, optional
        The robot at rest at the start without it.
    """

    def __init__(self, problem: Problem, root: Root | None = None) -> None:
        self.problem, self.root = problem, root or at_rest(problem)
        self._known: list[_Played] = [_Played([], []) for _ in range(PLAN_CERTIFICATE.levels)]
        # by level, gait and the gait before (or any before): how a cycle went tells where to step shortly
        self._went: dict[tuple[int, int, int | None], Trajectory] = {}

    def certify(self, gaits: Sequence[int]) -> Certificate:
        """Judge a sequence of gaits, a cycle each."""
        small = self.problem.margin_m < PLAN_CERTIFICATE.small_margin * self.problem.robot.length_m
        for level in range(1, PLAN_CERTIFICATE.levels):
            coarse, fine = self._played(gaits, (level - 1, level))
            # nodes twice as dense make integration better, not geometry
            seen = [_thinned(t, 2 ** (level - 1 if small else level)) for t in fine]
            certificate, sure = self._judged(gaits[: len(seen)], seen, self._error_m(fine, coarse))
            if sure:
                break
        return certificate

    def _played(self, gaits: Sequence[int], levels: tuple[int, int]) -> list[list[Trajectory]]:
        """Return the trajectories of all cycles, integrated with two levels' tolerances.

        Cycles after one that certainly runs into a wall are left out.
        """
        coarse, fine = (self._known[level] for level in levels)
        coarse.keep(gaits)
        fine.keep(gaits)
        for index in range(len(gaits) + 1):  # the coarser one is a cycle ahead
            due = [(level, k) for level, k in zip(levels, (index, index - 1)) if 0 <= k < len(gaits)]
            due = [(level, k) for level, k in due if len(self._known[level].cycles) <= k]
            found = run_batched([self._cycle(gaits, k, level) for level, k in due])
            for (level, _), cycle in zip(due, found):
                if isinstance(cycle, NoAnswerError):
                    raise cycle
                self._known[level].cycles.append(cycle)
            if index > 1 and self._in_a_wall(fine.cycles[index - 1]):
                break
        return [coarse.cycles[:index], fine.cycles[:index]]

    def _in_a_wall(self, cycle: Trajectory) -> bool:
        """Return whether a few bodies of a cycle tell that it overlaps a wall, whatever the error is."""
        problem = self.problem
        few = np.linspace(0, cycle.time_s.size - 1, PLAN_CERTIFICATE.first_bodies).astype(int)
        lines = points_in_room(centre_lines(problem.integrator, cycle.kappa[few]), cycle.pose[few])
        deepest = float(problem.body.estimate(lines).min()) + problem.field.error_m
        return deepest < -PLAN_CERTIFICATE.in_wall * problem.robot.length_m

    def _cycle(self, gaits: Sequence[int], index: int, level: int) -> Search[Trajectory]:
        """Find one cycle, as a search, from where the one before it ends."""
        problem, known = self.problem, self._known[level]
        before, now = gaits[index - 1] if index else self.root.gait, gaits[index]
        state = known.cycles[index - 1].final if index else self.root.state
        s = PLAN_CERTIFICATE
        timeline = problem.joints.timeline(before, now, s.stair_s / s.finer ** (level / 2))
        tolerance = s.tolerance * problem.robot.length_m / s.finer**level
        like = self._went.get((level, now, before))
        if like is None:
            like = self._known[level - 1].cycles[index] if level else self._went.get((level, now, None))
        played = yield from problem.integrator.travel(timeline, state, tolerance, like)
        self._went[level, now, before] = self._went[level, now, None] = played
        return problem.bent(played, before, now)

    def _judged(
        self, gaits: Sequence[int], cycles: list[Trajectory], bound: tuple[Array, Array]
    ) -> tuple[Certificate, bool]:
        """Return the certificate, and whether a finer integration would not change it for the better."""
        problem, root = self.problem, self.root
        time, pose, kappa, cycle = _joined(cycles)
        lines = points_in_room(centre_lines(problem.integrator, kappa), pose)
        arrived = arrival_index(problem.goal, pose)
        last = len(time) if arrived is None else arrived + 1
        time, pose, lines, kappa, cycle = time[:last], pose[:last], lines[:last], kappa[:last], cycle[:last]
        until_s, error_m = bound
        error = error_m[np.searchsorted(until_s, time).clip(max=until_s.size - 1)]
        # the start may be as near as it likes: nothing can be asked of it that integration could lose
        tube = np.concatenate([problem.tube_m(pose[cycle == k], gaits[k]) for k in np.unique(cycle)])
        wanted = problem.margin_m + np.where(cycle == 0, root.slack_m - error, tube - ROUNDING_M)
        seen = clearances(problem, lines, wanted + error)
        room = seen - error
        unseen = np.zeros(last)
        moved = np.hypot(*(lines[1:] - lines[:-1]).transpose(2, 0, 1)).max(axis=1, initial=0.0)
        unseen[1:] = moved / 2
        unseen += _sagitta(problem, kappa)
        between = float((room - unseen).min())
        close = room < wanted
        failed = int(cycle[close.argmax()]) if close.any() else None
        reason = ""
        if failed is not None:
            here = close & (cycle == failed)
            least_mm, wanted_mm = 1e3 * room[here].min(), 1e3 * wanted[here].max()
            reason = (
                f"the body keeps {least_mm:.2f} mm from walls in cycle {failed + 1}, "
                f"where {wanted_mm:.2f} mm are wanted"
            )
        elif between < 0:
            failed = int(cycle[int((room - unseen).argmin())])
            reason = f"contact between two instants of cycle {failed + 1} cannot be ruled out"
        elif arrived is None:
            away = float(problem.goal.distance(pose[-1, :2]))
            reason = f"the centre of mass ends {1e3 * away:.1f} mm short of the goal"
            failed = len(gaits) - 1
        states = tuple(t.final for t in cycles)
        worst = float(error.max())
        certificate = Certificate(
            failed is None, reason, float(room.min()), worst, between, failed, time, pose, lines, room, cycle,
            states,
        )  # fmt: skip
        if failed is None:
            return certificate, worst <= PLAN_CERTIFICATE.error_share * float(seen.min())
        return certificate, arrived is None or bool((seen + error < wanted).any())

    def _error_m(self, fine: list[Trajectory], coarse: list[Trajectory]) -> tuple[Array, Array]:
        """Return instants, and the bound on the finer integration's error until then.

        Errors in a ratio r at least differ by r - 1 of the finer one at least.
        """
        run = self.problem.integrator
        # the finer nodes lie a millisecond apart: what a line between two of them misses is a micrometre
        time, *fine_columns, _ = _joined(fine)
        at, pose, kappa, _ = _joined([_thinned(t, PLAN_CERTIFICATE.compared) for t in coarse])
        fine_pose, fine_kappa = (linear(time, columns, at) for columns in fine_columns)
        here = points_in_room(centre_lines(run, fine_kappa), fine_pose)
        there = points_in_room(centre_lines(run, kappa), pose)
        apart = np.hypot(*(here - there).transpose(2, 0, 1)).max(axis=1)
        return at, np.maximum.accumulate(apart) / (PLAN_CERTIFICATE.error_ratio - 1)


@dataclass
class _Played:
    """Gaits and the trajectories of their cycles."""

    gaits: Sequence[int]
    cycles: list[Trajectory]

    def keep(self, gaits: Sequence[int]) -> None:
        """Keep what these gaits begin with."""
        same = 0
        while same < min(len(gaits), len(self.cycles)) and gaits[same] == self.gaits[same]:
            same += 1
        self.gaits, self.cycles = list(gaits), self.cycles[:same]


def _thinned(trajectory: Trajectory, stride: int) -> Trajectory:
    """Return the trajectory at every so many nodes, the first and the last among them."""
    last = trajectory.time_s.size - 1
    kept = np.unique(np.append(np.arange(0, last, stride), last))
    nodes = [f.name for f in fields(trajectory) if f.name not in ("final", "error_m_s")]
    return replace(trajectory, **{name: getattr(trajectory, name)[kept] for name in nodes})


def _joined(played: Sequence[Trajectory]) -> tuple[Array, Array, Array, NDArray[np.int64]]:
    """Return times, poses, curvatures and cycle indices of consecutive trajectories."""
    begins = np.cumsum([0.0, *(t.time_s[-1] for t in played)])
    time = [played[0].time_s[:1], *(t.time_s[1:] + begin for t, begin in zip(played, begins))]
    pose = [played[0].pose[:1], *(t.pose[1:] for t in played)]
    kappa = [played[0].kappa[:1], *(t.kappa[1:] for t in played)]
    counts = [1, *(t.time_s.size - 1 for t in played)]
    cycle = np.repeat([0, *range(len(played))], counts)
    return np.concatenate(time), np.concatenate(pose), np.concatenate(kappa), cycle


def clearances(problem: Problem, lines: Array, wanted_m: Array | float = 0.0) -> Array:
    """Return the clearance of bodies (n, points, 2).

    It is exact below `exact_below`, and below what is `wanted_m` of each; above, a lower bound.
    """
    exact_below_m = np.maximum(PLAN_CERTIFICATE.exact_below * problem.robot.length_m, wanted_m)
    room = problem.body.estimate(lines) - problem.field.error_m
    close = room < exact_below_m
    if close.any():
        room[close] = problem.body.exact(lines[close], room[close] + problem.field.error_m)
    return room


def _sagitta(problem: Problem, kappa: Array) -> Array:
    """Return by how much the arcs leave the chords that stand for them, per instant."""
    chord = problem.robot.segment_length_m / POINTS_PER_ARC
    sagitta_m: Array = np.abs(kappa).max(axis=1) * chord**2 / 8
    return sagitta_m

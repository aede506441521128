"""What a window has to keep, as numbers that must not be negative, with their derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from planners.maze.places import Goal
from planners.refine.settings import WINDOW_LIMIT
from planners.refine.shots import WindowShot
from planners.search.problem import Problem
from srs_opt.manoeuvre.rows import body_points
from srs_opt.manoeuvre.settings import CONSTRAINT
from srs_opt.model.state import FORWARD, HEADING, PLACE, X, Y

Array = NDArray[np.float64]
_HAIR_M = 1e-6  # of difference quotients


@dataclass(frozen=True)
class End:
    """Where a window ends: a state of the plan, or in the goal (`state` is None)."""

    state: Array | None = None


class Values(NamedTuple):
    """Limits in lengths: values (n,), to be at least 0, and Jacobian (n, unknowns), empty where not asked."""

    values: Array
    jacobian: Array


class Limits:
    """Measures windows of one problem.

    Parameters
    ----------
    problem : Problem
    end : End
    slack_m : float
        By which the margin may be missed in the window's first cycle (negative; the start of the way).
    more_spare : float
        Factor on `WindowLimitSettings.spare`.
    """

    def __init__(self, problem: Problem, end: End, slack_m: float = 0.0, more_spare: float = 1.0) -> None:
        self.problem, self.end, self.slack_m = problem, end, slack_m
        self.spare_m = more_spare * WINDOW_LIMIT.spare * problem.robot.length_m

    @property
    def ends(self) -> int:
        """Number of limits of the end, which come first."""
        if self.end.state is not None:
            return 7 + 2 * self.problem.robot.segments
        return 1 if self.problem.goal.heading is None else 3

    def __call__(self, shots: list[WindowShot]) -> list[Values]:
        """Return the limits of several simulated windows."""
        rooms = self._rooms(shots)
        found = []
        for shot, room in zip(shots, rooms):
            parts = [*self._ends(shot), room]
            values = np.concatenate([p.values for p in parts])
            found.append(Values(values, np.concatenate([p.jacobian for p in parts])))
        return found

    def _ends(self, shot: WindowShot) -> list[Values]:
        state, wanted = shot.states[-1], self.end.state
        jacobian = None if shot.sensitivity is None else shot.sensitivity[-1]
        s, length = WINDOW_LIMIT, self.problem.robot.length_m
        lever_m = CONSTRAINT.lever * length
        if wanted is None:
            return self._arrived(state, jacobian)
        bands = [
            (X, s.place_off * length, 1.0),
            (Y, s.place_off * length, 1.0),
            (HEADING, s.heading_rad, lever_m),
        ]
        found = []
        for index, tolerance, unit in bands:
            for sign in (1.0, -1.0):
                value = unit * (tolerance - sign * (state[index] - wanted[index]))
                found.append(_row(value, None if jacobian is None else -sign * unit * jacobian[index]))
        forward = 1.0 if wanted[FORWARD] >= 0 else -1.0
        value = lever_m * (forward * (state[FORWARD] - wanted[FORWARD]) + s.speed_off * length)
        found.append(_row(value, None if jacobian is None else lever_m * forward * jacobian[FORWARD]))
        return found + self._bends(shot, jacobian)

    def _bends(self, shot: WindowShot, jacobian: Array | None) -> list[Values]:
        where = self.problem.integrator.layout.kappa
        assert self.end.state is not None
        bend_m2 = CONSTRAINT.bend * self.problem.robot.length_m * self.problem.robot.length_m
        wanted, largest = self.end.state[where], float(np.abs(shot.states[:, where]).max())
        found = []
        for k, index in enumerate(range(where.start, where.stop)):
            off = shot.states[-1, index] - wanted[k]
            for sign in (1.0, -1.0):
                value = bend_m2 * (WINDOW_LIMIT.bend * largest - sign * off)
                found.append(_row(value, None if jacobian is None else -sign * bend_m2 * jacobian[index]))
        return found

    def _arrived(self, state: Array, jacobian: Array | None) -> list[Values]:
        goal, lever_m = self.problem.goal, CONSTRAINT.lever * self.problem.robot.length_m
        inside, toward = depth(goal, state[PLACE])
        found = [_row(inside - self.spare_m / 4, None if jacobian is None else toward @ jacobian[PLACE])]
        if goal.heading is not None:
            off = (state[HEADING] - goal.heading + np.pi) % (2 * np.pi) - np.pi
            for sign in (1.0, -1.0):
                value = lever_m * (WINDOW_LIMIT.heading_share * goal.heading_tolerance - sign * off)
                found.append(_row(value, None if jacobian is None else -sign * lever_m * jacobian[HEADING]))
        return found

    def _rooms(self, shots: list[WindowShot]) -> list[Values]:
        """Return the clearance beyond the margin, where it is small: of each body's nearest points."""
        problem, run = self.problem, self.problem.integrator
        looked = [_looks(shot) for shot in shots]
        bodies = [body_points(run, shot.states[at], None)[0] for shot, at in zip(shots, looked)]
        wanted = [self._wanted(shot, at) for shot, at in zip(shots, looked)]
        near_m = WINDOW_LIMIT.near * problem.robot.length_m
        chosen, points = [], []
        for body, margin in zip(bodies, wanted):
            rough = problem.field.clearance(body) - margin[:, None]
            lowest = np.ones_like(rough, dtype=bool)
            lowest[:, 1:] &= rough[:, 1:] <= rough[:, :-1]
            lowest[:, :-1] &= rough[:, :-1] <= rough[:, 1:]
            which = np.nonzero((rough < near_m + problem.field.error_m) & lowest)
            chosen.append(which)
            points.append(body[which])
        room = np.split(self._clear(np.concatenate(points)), np.cumsum([len(p) for p in points])[:-1])
        found = []
        for shot, at, which, where, clear, margin in zip(shots, looked, chosen, points, room, wanted):
            values = clear - margin[which[0]]
            jacobian = np.zeros((values.size, 0))
            if shot.sensitivity is not None:
                jacobian = self._room_jacobian(shot, at, which, where, clear)
            found.append(Values(values, jacobian))
        return found

    def _room_jacobian(
        self, shot: WindowShot, at: NDArray[np.int64], which: tuple[Array, ...], where: Array, clear: Array
    ) -> Array:
        assert shot.sensitivity is not None
        if not len(where):
            return np.zeros((0, shot.window.size))
        aside = [self._clear(where + hair) for hair in _HAIR_M * np.eye(2)]
        toward = (np.stack(aside, axis=1) - clear[:, None]) / _HAIR_M
        bodies, index = np.unique(which[0], return_inverse=True)
        nodes = at[bodies]
        _, lines = body_points(self.problem.integrator, shot.states[nodes], shot.sensitivity[nodes])
        assert lines is not None
        return np.asarray(np.einsum("nk,nkm->nm", toward, lines[index, which[1]]))

    def _clear(self, points: Array) -> Array:
        return self.problem.maze.point_clearances(points)

    def _wanted(self, shot: WindowShot, at: NDArray[np.int64]) -> Array:
        """Return the distance of the centre line from walls that is asked for at nodes."""
        wanted = np.full(at.size, self.problem.body.reach_m + self.spare_m)
        wanted[shot.time_s[at] < shot.window.ends_s[0]] += self.slack_m
        return wanted


def depth(goal: Goal, point: Array) -> tuple[float, Array]:
    """Return how deep inside the goal (negative: outside) a point lies, m, and the derivative by it."""
    if not goal.boxes:
        away = np.array([goal.x, goal.y]) - point
        distance = float(np.hypot(*away))
        return goal.radius - distance, away / max(distance, 1e-9)
    region = shapely.union_all([shapely.box(*box) for box in goal.boxes])

    def inside(at: Array) -> float:
        where = shapely.Point(at)
        distance = float(shapely.distance(region.boundary, where))
        return distance if region.contains(where) else -distance

    value = inside(point)
    return value, np.array([inside(point + hair) - value for hair in _HAIR_M * np.eye(2)]) / _HAIR_M


def _row(value: float, jacobian: Array | None) -> Values:
    return Values(np.array([value]), np.zeros((1, 0)) if jacobian is None else jacobian[None, :])


def _looks(shot: WindowShot) -> NDArray[np.int64]:
    """Return the nodes at which the body is measured."""
    wanted = np.arange(0.0, shot.time_s[-1], WINDOW_LIMIT.look_s)
    nodes = np.searchsorted(shot.time_s, wanted - 1e-9).clip(max=shot.time_s.size - 1)
    return np.unique(np.append(nodes, shot.time_s.size - 1))

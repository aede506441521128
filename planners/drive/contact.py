"""Watching the body while it is driven: contact of the outline at every node, arrival, the record."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planners.plan.settings import PLAN_CERTIFICATE
from planners.search.clearance import BodyClearance
from planners.search.problem import Problem
from planners.search.tree import arrival_index
from srs_opt.geometry import points_in_room
from srs_opt.robot import Robot
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.shapes import centre_lines

Array = NDArray[np.float64]


class BodyWatch:
    """Measures the driven robot's whole body against the walls.

    Attributes
    ----------
    smallest_m : float
        Smallest clearance so far.
    now_m : float
        Clearance at the last instant looked at.
    touched : bool
    where_touched : str
    """

    def __init__(self, problem: Problem, robot: Robot, run: Integrator) -> None:
        self._goal = problem.goal
        self._body = BodyClearance(problem.maze, problem.field, robot.body_width_m / 2, 0.0)
        self._run = run
        self._exact_below_m = PLAN_CERTIFICATE.exact_below * robot.length_m
        self._time: list[Array] = []
        self._pose: list[Array] = []
        self._lines: list[Array] = []
        self._end_s = 0.0
        self.smallest_m = self.now_m = np.inf
        self.touched = False
        self.where_touched = ""

    def look(self, time_s: Array, pose: Array, kappa: Array, *, ends: bool = True) -> bool:
        """Take in a motion that begins now; return whether the goal was reached (the record ends there).

        Times (n,) start at 0, poses are (n, 3), curvatures (n, N-1). The record also ends at contact.
        """
        lines = points_in_room(centre_lines(self._run, kappa), pose)
        room = self._clearances(lines)
        arrived = arrival_index(self._goal, pose) if ends else None
        contact = int(np.argmax(room <= 0)) if (room <= 0).any() else None
        if contact is not None and (arrived is None or contact <= arrived):
            self.touched, arrived, last = True, None, contact + 1
            at = lines[contact][int(self._body.field.clearance(lines[contact]).argmin())]
            self.where_touched = f"({at[0]:.3f}, {at[1]:.3f})"
        else:
            last = len(room) if arrived is None else arrived + 1
        self.smallest_m = min(self.smallest_m, float(room[:last].min()))
        self.now_m = float(room[last - 1])
        self._time.append(self._end_s + time_s[:last])
        self._pose.append(pose[:last])
        self._lines.append(lines[:last])
        self._end_s += float(time_s[last - 1])
        return arrived is not None

    @property
    def time_s(self) -> float:
        """Time so far."""
        return self._end_s

    def record(self) -> tuple[Array, Array, Array]:
        """Return times (n,), poses (n, 3) and centre lines (n, points, 2) of everything looked at."""
        return np.concatenate(self._time), np.concatenate(self._pose), np.concatenate(self._lines)

    def _clearances(self, lines: Array) -> Array:
        """Return clearances (n,): exact where walls are near, else a lower bound."""
        room = self._body.estimate(lines) - self._body.field.error_m
        close = room < self._exact_below_m
        if close.any():
            room[close] = self._body.exact(lines[close], room[close] + self._body.field.error_m)
        return room

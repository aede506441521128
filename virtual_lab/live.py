"""The true robot moving on in time, driven by valves that somebody else sets."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from virtual_lab.assemble import NOMINAL, assemble, push_table
from virtual_lab.errors import LabError
from virtual_lab.simulate import Run, look, rest_state, sample
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth


class LiveRobot:
    """The robot of `truth`, straight and at rest, its centre of mass at (x, y).

    Attributes
    ----------
    time_s : float
        Since the start.
    """

    def __init__(self, truth: Truth, x_m: float = 0.0, y_m: float = 0.0, heading_rad: float = 0.0) -> None:
        names = {name for name, _ in truth.hidden()}
        if unknown := names & {"dead_time", "slow_valve"}:
            raise LabError(f"{', '.join(sorted(unknown))}: the live robot keeps no memory of earlier valves")
        if truth.parameters.valve_delay_s > 0:
            raise LabError("valve_delay_s: the live robot keeps no memory of earlier valves")
        self._truth, self.time_s = truth, 0.0
        self._hidden = dict(truth.hidden())
        still = Trial("live", 1.0, 0.0, kind="still")
        self._tables = assemble(truth, still, 1.0)
        segments = truth.parameters.links - 1
        self._shape = np.zeros((segments, 4))
        self._state = rest_state(self._tables, heading_rad)
        centre = self.look().centre_of_mass()[0]
        self._state[:2] = x_m - centre[0], y_m - centre[1]

    def advance(self, valves: np.ndarray, pressure_kpa: float, duration_s: float) -> None:
        """Move on with valves (N-1,) held at S = 1, -1 or 0 and the regulator at `pressure_kpa`."""
        t = self._tables
        trial = Trial("live", 1.0, pressure_kpa)
        sign = np.asarray(valves, dtype=float)[None, :]
        push = push_table(self._truth, trial, sign, NOMINAL, self._hidden)
        edges = np.array([self.time_s, self.time_s + duration_s])
        steps = np.array([max(math.ceil(duration_s / t.longest_step_s), 1)])
        tables = dataclasses.replace(t, push=push, sign=sign, edges=edges, steps=steps)
        row = sample(tables, self._state, self._shape, edges[1:])[-1]
        self._state = row[: self._state.size].copy()
        self.time_s = float(edges[1])

    def look(self) -> Run:
        """Return places and headings of all links now."""
        row = np.concatenate([self._state, self._shape[:, 0], self._shape[:, 1]])
        return look(self._tables, row[None, :], np.array([self.time_s]))

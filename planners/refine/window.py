"""Consecutive cycles whose switches, ends and pressures are free: what the optimization moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planners.motion.valves import Joint, ValveLimits, intervals_of
from srs_opt.gait import Gait
from srs_opt.manoeuvre.settings import REGULATOR
from srs_opt.manoeuvre.valves import ValveRow
from srs_opt.simulate.timeline import Timeline

Array = NDArray[np.float64]
SAME_S = 1e-9  # instants nearer than this are one


class Edge(NamedTuple):
    """An instant at which valves or pressure change.

    Attributes
    ----------
    column : int
        The unknown that moves it, -1 if nothing does.
    time_s : float
    segment : int
        Whose valve is switched, -1 where the pressure changes.
    """

    column: int
    time_s: float
    segment: int


@dataclass(frozen=True)
class Window:
    """Cycles that follow each other, from time 0 on.

    Attributes
    ----------
    rows : tuple of ValveRow
        One per segment, over all cycles.
    cycle_of : tuple of tuple of int
        The cycle that each switch belongs to, like the rows' times.
    ends_s : tuple of float
        Of the cycles.
    pressure_kpa : tuple of float
        Of the cycles.
    ramp_s : tuple of float
        In which the pressure of a cycle is reached, from its begin on.
    from_kpa : float
        Pressure before.
    """

    rows: tuple[ValveRow, ...]
    cycle_of: tuple[tuple[int, ...], ...]
    ends_s: tuple[float, ...]
    pressure_kpa: tuple[float, ...]
    ramp_s: tuple[float, ...]
    from_kpa: float

    @staticmethod
    def of_cycles(cycles: Sequence[Joint], limits: ValveLimits) -> Window:
        """Return cycles with all that they play; where pressures are free, all but a start from rest ramp."""
        begins = np.concatenate([[0.0], np.cumsum([c.gait.period_s for c in cycles])])
        segments = cycles[0].gait.segments
        states: list[list[int]] = [[] for _ in range(segments)]
        times: list[list[float]] = [[] for _ in range(segments)]
        owners: list[list[int]] = [[] for _ in range(segments)]
        for k, cycle in enumerate(cycles):
            lengths, valves = cycle.gait.phases()
            starts = begins[k] + np.cumsum([0.0, *lengths[:-1]])
            for segment, row in enumerate(valves):
                for start, state in zip(starts, row):
                    if not states[segment]:
                        states[segment].append(int(state))
                    elif states[segment][-1] != int(state):
                        states[segment].append(int(state))
                        times[segment].append(float(start))
                        owners[segment].append(k)
        return Window(
            tuple(ValveRow(tuple(s), tuple(t)) for s, t in zip(states, times)),
            tuple(map(tuple, owners)),
            tuple(map(float, begins[1:])),
            tuple(c.gait.pressure_kpa for c in cycles),
            tuple(c.ramp_s if c.ramp_s or limits.pressure_rate_kpa_s else REGULATOR.settle_s for c in cycles),
            cycles[0].from_kpa,
        )

    @property
    def cycles(self) -> int:
        """Number of cycles."""
        return len(self.ends_s)

    @property
    def switches(self) -> int:
        """Number of switches."""
        return sum(len(row.times_s) for row in self.rows)

    @property
    def size(self) -> int:
        """Number of unknowns: switches, cycle ends, pressures."""
        return self.switches + 2 * self.cycles

    def unknowns(self) -> Array:
        """Return switch times segment by segment, cycle ends, pressures."""
        return np.array([t for row in self.rows for t in row.times_s] + [*self.ends_s, *self.pressure_kpa])

    def moved(self, x: Array) -> Window:
        """Return the window with other unknowns."""
        rows, first = [], 0
        for row in self.rows:
            count = len(row.times_s)
            rows.append(ValveRow(row.states, tuple(map(float, x[first : first + count]))))
            first += count
        ends, kpa = x[first : first + self.cycles], x[first + self.cycles :]
        return Window(
            tuple(rows),
            self.cycle_of,
            tuple(map(float, ends)),
            tuple(map(float, kpa)),
            self.ramp_s,
            self.from_kpa,
        )

    def by_cycles(self) -> Array:
        """Return the unknowns' derivatives (unknowns, unknowns) by what bends the motion least.

        By switches within cycles, durations of cycles (which stretch their switches and delay what comes
        later), and pressures.
        """
        n, begins = self.switches, np.array([0.0, *self.ends_s])
        owners = np.array([k for row in self.cycle_of for k in row], dtype=int)
        found = np.eye(self.size)
        found[:n, n : n + self.cycles] = owners[:, None] > np.arange(self.cycles)
        times = self.unknowns()[:n]
        found[np.arange(n), n + owners] = (times - begins[owners]) / np.diff(begins)[owners]
        found[n : n + self.cycles, n : n + self.cycles] = np.tri(self.cycles)
        return found

    def edges(self) -> list[Edge]:
        """Return all instants of change inside the window."""
        found, column = [], 0
        for segment, row in enumerate(self.rows):
            for time in row.times_s:
                found.append(Edge(column, time, segment))
                column += 1
        begin = 0.0
        for k, ramp_s in enumerate(self.ramp_s):
            if ramp_s:
                treads = max(1, round(ramp_s / REGULATOR.stair_s))
                found += [
                    Edge(column + k - 1 if k else -1, begin + ramp_s * j / treads, -1)
                    for j in range(treads + 1)
                ]
            begin = self.ends_s[k]
        return [e for e in found if e.time_s < self.ends_s[-1] - SAME_S]

    def pressure_shares(self, time_s: Array) -> Array:
        """Return the parts of the pressures, the one before first, at instants (n, cycles + 1)."""
        begins = np.array([0.0, *self.ends_s[:-1]])
        k = np.clip(np.searchsorted(begins, time_s, side="right") - 1, 0, self.cycles - 1)
        ramp = np.array(self.ramp_s)[k]
        treads = np.maximum(np.round(ramp / REGULATOR.stair_s), 1.0)
        along = np.divide(time_s - begins[k], ramp, out=np.ones_like(time_s), where=ramp > 0)
        share = np.clip((np.floor(along * treads) + 0.5) / treads, 0.0, 1.0)
        share = np.where((ramp > 0) & (along < 1), share, 1.0)
        found = np.zeros((time_s.size, self.cycles + 1))
        at = np.arange(time_s.size)
        found[at, k + 1] = share
        found[at, k] += 1 - share
        return found

    def pressures(self, time_s: Array) -> Array:
        """Return the pressure at instants."""
        return np.asarray(self.pressure_shares(time_s) @ np.array([self.from_kpa, *self.pressure_kpa]))

    def timeline(self, until_s: float | None = None) -> Timeline:
        """Return the phases of held valves and pressure."""
        end = self.ends_s[-1] if until_s is None else until_s
        inner = np.sort([e.time_s for e in self.edges() if SAME_S < e.time_s < end - SAME_S])
        inner = inner[np.append(True, np.diff(inner) > SAME_S)] if inner.size else inner
        edges = np.array([0.0, *inner, end])
        middles = (edges[:-1] + edges[1:]) / 2
        valve = np.array(
            [np.array(r.states)[np.searchsorted(r.times_s, middles)] for r in self.rows], dtype=float
        )
        return Timeline(np.diff(edges), valve, self.pressures(middles), np.ones(middles.size))

    def first(self, cycles: int) -> Window:
        """Return the first cycles alone."""
        rows, owners = [], []
        for row, mine in zip(self.rows, self.cycle_of):
            count = sum(owner < cycles for owner in mine)
            rows.append(ValveRow(row.states[: count + 1], row.times_s[:count]))
            owners.append(mine[:count])
        return Window(
            tuple(rows),
            tuple(owners),
            self.ends_s[:cycles],
            self.pressure_kpa[:cycles],
            self.ramp_s[:cycles],
            self.from_kpa,
        )

    def cycle(self, k: int) -> Joint:
        """Return one of the cycles as valves and regulator play it."""
        begin = self.ends_s[k - 1] if k else 0.0
        rows = []
        for row, owners in zip(self.rows, self.cycle_of):
            first = row.at(begin + SAME_S)
            inner = [t - begin for t, owner in zip(row.times_s, owners) if owner == k and t > begin + SAME_S]
            rows.append(intervals_of(first, inner))
        gait = Gait(self.ends_s[k] - begin, self.pressure_kpa[k], tuple(rows))
        return Joint(gait, self.pressure_kpa[k - 1] if k else self.from_kpa, self.ramp_s[k])

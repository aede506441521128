"""The valves of a manoeuvre: per segment a row of states and the times at which one gives way to the next."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from srs_opt.errors import InputError
from srs_opt.gait import Gait
from srs_opt.simulate.timeline import Timeline

COINCIDENT_S = 1e-9


@dataclass(frozen=True)
class ValveRow:
    """One segment's valves.

    Attributes
    ----------
    states : tuple of int
        +1 bends left, -1 right, 0 vented; one more than times.
    times_s : tuple of float
        When one state gives way to the next, ascending.
    """

    states: tuple[int, ...]
    times_s: tuple[float, ...]

    def at(self, time_s: float) -> int:
        """Return the state right after an instant."""
        return self.states[int(np.searchsorted(self.times_s, time_s, side="right"))]

    def without_pulse(self, k: int) -> ValveRow:
        """Return the row without the state that begins at switch `k` and ends at the next one."""
        return ValveRow(self.states[: k + 1] + self.states[k + 3 :], self.times_s[:k] + self.times_s[k + 2 :])


@dataclass(frozen=True)
class ValvePlan:
    """What the valves do from time 0 to the end.

    Attributes
    ----------
    rows : tuple of ValveRow
        One per segment, tail to head.
    duration_s, pressure_kpa : float
    early : tuple of (until_s, kpa)
        Other pressures before, ascending in time: stairs of the regulator's ramp. They stay where they are.
    """

    rows: tuple[ValveRow, ...]
    duration_s: float
    pressure_kpa: float
    early: tuple[tuple[float, float], ...] = ()

    @staticmethod
    def of_gaits(gaits: tuple[Gait, ...], duration_s: float) -> ValvePlan:
        """Return gaits, a cycle each, the last one repeated; all at the last one's pressure."""
        events: list[list[tuple[float, int]]] = [[] for _ in range(gaits[0].segments)]
        begin, k = 0.0, 0
        while begin < duration_s - COINCIDENT_S:
            gait = gaits[min(k, len(gaits) - 1)]
            lengths, valves = gait.phases()
            for start, states in zip(begin + np.cumsum([0.0, *lengths[:-1]]), valves.T):
                for row, state in zip(events, states):
                    if start < duration_s - COINCIDENT_S and (not row or row[-1][1] != state):
                        row.append((float(start), int(state)))
            begin, k = begin + gait.period_s, k + 1
        rows = tuple(ValveRow(tuple(s for _, s in row), tuple(t for t, _ in row[1:])) for row in events)
        return ValvePlan(rows, duration_s, gaits[-1].pressure_kpa)

    @property
    def switches(self) -> int:
        """Number of switches of all segments."""
        return sum(len(row.times_s) for row in self.rows)

    @property
    def fills(self) -> int:
        """Number of chambers that are filled."""
        return sum(state != 0 for row in self.rows for state in row.states)

    def times(self) -> np.ndarray:
        """Return all switch times, row after row."""
        return np.array([t for row in self.rows for t in row.times_s])

    def with_times(self, times_s: np.ndarray, duration_s: float, pressure_kpa: float) -> ValvePlan:
        """Return the plan with other times, in the order of `times`."""
        rows, first = [], 0
        for row in self.rows:
            mine = times_s[first : first + len(row.times_s)]
            rows.append(replace(row, times_s=tuple(float(t) for t in mine)))
            first += len(row.times_s)
        return ValvePlan(tuple(rows), float(duration_s), float(pressure_kpa), self.early)

    def timeline(self, frequency_hz: float = 1.0) -> Timeline:
        """Return the phases of held valves."""
        untils = np.array([until for until, _ in self.early])
        inner = np.sort(np.concatenate([self.times(), untils]))
        inner = inner[(inner > COINCIDENT_S) & (inner < self.duration_s - COINCIDENT_S)]
        if inner.size:
            # switches that coincide but for rounding end one phase, not one of no length
            inner = inner[np.append(True, np.diff(inner) > COINCIDENT_S)]
        edges = np.array([0.0, *inner, self.duration_s])
        # asked in the middle of a phase, where rounding of its edges does not matter
        middles = (edges[:-1] + edges[1:]) / 2
        valve = np.array([[row.at(t) for t in middles] for row in self.rows], dtype=float)
        pressures = np.array([kpa for _, kpa in self.early] + [self.pressure_kpa])
        pressure = pressures[np.searchsorted(untils, middles, side="right")]
        count = middles.size
        return Timeline(np.diff(edges), valve, pressure, np.full(count, frequency_hz))

    def trimmed(self) -> ValvePlan:
        """Return the plan without switches at or before its begin and at or after its end."""
        rows = []
        for row in self.rows:
            first = int(np.searchsorted(row.times_s, COINCIDENT_S, side="right"))
            last = int(np.searchsorted(row.times_s, self.duration_s - COINCIDENT_S))
            last = max(last, first)
            rows.append(ValveRow(row.states[first : last + 1], row.times_s[first:last]))
        return replace(self, rows=tuple(rows))

    def shortest_dwell_s(self, age_s: tuple[float, ...]) -> float:
        """Return the shortest time for which a valve is held between two switches.

        Parameters
        ----------
        age_s : tuple of float
            For how long each segment's first state has stood at time 0 (infinite at rest).
        """
        shortest = math.inf
        for row, age in zip(self.rows, age_s):
            gaps = np.diff([-age, *row.times_s]) if row.times_s else np.array([math.inf])
            shortest = min(shortest, float(gaps.min()))
        return shortest

    def off_tick_s(self, tick_s: float) -> float:
        """Return by how much the worst switch misses the ticks."""
        times = np.append(self.times(), self.duration_s)
        return float(np.abs(times - np.round(times / tick_s) * tick_s).max())

    def switch_records(self) -> list[dict[str, float]]:
        """Return every switch as JSON holds it: segment (from 1), time, state from then on."""
        records = []
        for segment, row in enumerate(self.rows, start=1):
            for time, state in zip((0.0, *row.times_s), row.states):
                records.append({"segment": segment, "at_s": round(time, 9), "valve": state})
        return sorted(records, key=lambda r: (r["at_s"], r["segment"]))


def gait_end(gait: Gait) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Return every segment's valve state at the gait's time 0, just before any switch there, and its age."""
    states, ages = [], []
    for segment in range(gait.segments):
        edges = [(t, s) for on, off in gait.intervals[segment] for t, s in ((on, 1), (off, -1))]
        time, state = max(edges, key=lambda e: e[0] if e[0] > COINCIDENT_S else 0.0)
        if time <= COINCIDENT_S:
            raise InputError(f"gait: segment {segment + 1} has no switch inside the cycle")
        states.append(state)
        ages.append(gait.period_s - time)
    return tuple(states), tuple(ages)

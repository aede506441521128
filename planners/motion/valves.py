"""What valves and the pressure regulator can play, and the cycles that join one gait to the next.

A gait holds its valves long enough by itself, but where one gait follows another a valve may have been
switched just before the cycle's end, or the next switch may come just after its start. The first cycle of the
new gait is then a joining cycle: a switch that comes too early waits for the dwell, or a pulse that is too
short is left out, whichever changes less. Only the start of a cycle is changed, so that what follows a
cycle depends on its gait alone.

The regulator goes linearly from the pressure of the last cycle to that of the next.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from srs_opt.errors import InputError, NoAnswerError
from srs_opt.gait import Gait, Interval
from srs_opt.gait_opt.table import GaitTable, TableGait
from srs_opt.manoeuvre.settings import REGULATOR
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import Robot
from srs_opt.simulate.timeline import Timeline

_SAME_S = 1e-9


@dataclass(frozen=True)
class ValveLimits:
    """What valves, controller and regulator can do.

    Attributes
    ----------
    min_dwell_s : float
        Least time between two switches of one segment.
    tick_s : float
        The controller's tick: cycles take whole ticks, and switches come on them.
    pressure_rate_kpa_s : float, optional
        Of the regulator. Without, every change of pressure takes `REGULATOR.settle_s`.
    """

    min_dwell_s: float = 0.02
    tick_s: float = 0.001
    pressure_rate_kpa_s: float | None = None

    @property
    def dwell_s(self) -> float:
        """Least dwell in whole ticks."""
        return math.ceil(self.min_dwell_s / self.tick_s - 1e-6) * self.tick_s

    @property
    def assumed_ramp_s(self) -> float | None:
        """How long every change of pressure is taken to last where the regulator's rate is not given."""
        return REGULATOR.settle_s if self.pressure_rate_kpa_s is None else None

    def ramp_s(self, from_kpa: float, to_kpa: float) -> float:
        """Return how long a change of pressure takes."""
        if from_kpa == to_kpa:
            return 0.0
        if self.pressure_rate_kpa_s is None:
            return REGULATOR.settle_s
        return abs(to_kpa - from_kpa) / self.pressure_rate_kpa_s


DEFAULT_LIMITS = ValveLimits()


@dataclass(frozen=True)
class Joint:
    """The first cycle of a gait after another.

    Attributes
    ----------
    gait : Gait
        What is played, for one period from its time 0.
    from_kpa : float
        Pressure at its begin.
    ramp_s : float
        In which the pressure goes to that of the gait.
    """

    gait: Gait
    from_kpa: float
    ramp_s: float

    def timeline(self, stair_s: float | None = None) -> Timeline:
        """Return the cycle as valves and regulator play it, the ramp in stairs of that length at most."""
        cycle = Timeline.of_gait(self.gait, self.gait.period_s)
        return _ramped(cycle, self.from_kpa, self.ramp_s, stair_s) if self.ramp_s else cycle


class Joints:
    """How every gait of a table follows every other (n gaits; before the first is rest, number n).

    Cycles made for one plan have the numbers after rest and follow each other in that order only.

    Parameters
    ----------
    gaits : GaitTable
        As `playable` returns it.
    limits : ValveLimits
    own : sequence of Joint
        Cycles made for one plan.
    """

    def __init__(
        self, gaits: GaitTable, limits: ValveLimits = DEFAULT_LIMITS, own: Sequence[Joint] = ()
    ) -> None:
        self.limits, self.own = limits, tuple(own)
        self._table = gaits
        self._gaits = [entry.gait for entry in gaits.gaits]
        self._plain = [Joint(gait, gait.pressure_kpa, 0.0) for gait in self._gaits]
        self._known: dict[tuple[int, int], Joint | None] = {}

    @property
    def rest(self) -> int:
        """Number of the robot at rest, vented."""
        return len(self._gaits)

    def joint(self, before: int, now: int) -> Joint | None:
        """Return the cycle of a gait after another (the gait's own where that will do), None if none can."""
        if now > self.rest:
            first = now == self.rest + 1
            return self.own[now - self.rest - 1] if first or before == now - 1 else None
        if before == now:
            return self._plain[now]
        if (before, now) not in self._known:
            self._known[before, now] = self._made(before, now)
        return self._known[before, now]

    def timeline(self, before: int, now: int, stair_s: float | None = None) -> Timeline:
        """Return the valves of a cycle of `now` after `before`; a joint must exist."""
        joint = self.joint(before, now)
        assert joint is not None  # searches offer no others
        return joint.timeline(stair_s)

    def is_plain(self, before: int, now: int) -> bool:
        """Whether the gait's own cycle is played after another gait."""
        return now < self.rest and self.joint(before, now) is self._plain[now]

    def with_own(self, own: Sequence[Joint]) -> Joints:
        """Return the same with cycles made for one plan."""
        return Joints(self._table, self.limits, own)

    def gait(self, number: int) -> Gait:
        """Return what a cycle plays by itself; `number` is not rest."""
        return self._gaits[number] if number < self.rest else self.own[number - self.rest - 1].gait

    def vent(self, before: int, duration_s: float) -> Timeline:
        """Return the valves of venting after a cycle: each segment's hold until they have dwelt."""
        if before == self.rest:
            return Timeline.vent(self._gaits[0].segments, duration_s, 0.0)
        gait = self.gait(before)
        state, age = gait_end(gait)
        wait = np.array([max(0.0, self._later(self.limits.dwell_s - a)) for a in age])
        edges = np.unique([0.0, *wait, wait.max() + duration_s])
        middles = (edges[:-1] + edges[1:]) / 2
        valve = np.where(middles < wait[:, None], np.array(state)[:, None], 0.0)
        return Timeline.constant(np.diff(edges), valve, gait.pressure_kpa, gait.frequency_hz)

    def _made(self, before: int, now: int) -> Joint | None:
        gait = self._gaits[now]
        if before == self.rest:
            state, age, from_kpa = [0] * gait.segments, [math.inf] * gait.segments, gait.pressure_kpa
        else:
            (state, age), from_kpa = gait_end(self.gait(before)), self.gait(before).pressure_kpa
        ramp_s = self.limits.ramp_s(from_kpa, gait.pressure_kpa)
        if ramp_s > gait.period_s:
            return None  # the next joint could not know where the pressure is
        rows = []
        for segment in range(gait.segments):
            row = self._row(gait, segment, state[segment], age[segment])
            if row is None:
                return None
            rows.append(row)
        if not ramp_s and tuple(rows) == gait.intervals:
            return self._plain[now]
        return Joint(Gait(gait.period_s, gait.pressure_kpa, tuple(rows)), from_kpa, ramp_s)

    def _row(self, gait: Gait, segment: int, state: int, age_s: float) -> tuple[Interval, ...] | None:
        """Return a segment's on-intervals in the joining cycle, None if there are none that will do."""
        begin, switches = _switches(gait.intervals[segment])
        inner = list(switches)
        # what comes later than the gait's own last switch must have dwelt when the cycle ends
        latest_s = max(inner[-1], gait.period_s - self.limits.dwell_s)
        if state == 0:  # begun as the gait does, or with what its first switch leads to
            ways = [(0.0, begin, inner, 0.0), (inner[0], -begin, inner[1:], 0.0)]
        elif state == begin:
            ways = [(0.0, state, inner, -age_s)]
        else:
            ways = [(0.0, state, [0.0, *inner], -age_s)]
        found = [
            (cost + more, first, times)
            for cost, first, wanted, last in ways
            for more, times in self._kept(wanted, last, latest_s)
            if any(t > _SAME_S for t in times)  # a valve that never switches is no gait's
        ]
        if not found:
            return None
        _, first, times = min(found, key=lambda way: way[0])
        if times[0] < _SAME_S:
            first, times = -first, times[1:]
        return gait.intervals[segment] if (first, times) == (begin, inner) else intervals_of(first, times)

    def _kept(self, wanted: list[float], last_s: float, latest_s: float) -> list[tuple[float, list[float]]]:
        """Return the ways to keep the dwell: by how long the valve stands otherwise than wanted, switches.

        Parameters
        ----------
        wanted : list of float
            Switches of the gait.
        last_s : float
            The switch before the first of them.
        latest_s : float
            No switch may wait until later.
        """
        if not wanted:
            return [(0.0, [])]
        switch = wanted[0]
        dwelt = self._later(last_s + self.limits.dwell_s) if math.isfinite(last_s) else -math.inf
        if switch >= dwelt - _SAME_S:
            return [(cost, [switch, *rest]) for cost, rest in self._kept(wanted[1:], switch, latest_s)]
        ways = []
        if dwelt <= latest_s + _SAME_S:
            later = self._kept(wanted[1:], dwelt, latest_s)
            ways += [(cost + dwelt - switch, [dwelt, *rest]) for cost, rest in later]
        if len(wanted) > 1:
            left_out = self._kept(wanted[2:], last_s, latest_s)
            ways += [(cost + wanted[1] - switch, rest) for cost, rest in left_out]
        return ways

    def _later(self, time_s: float) -> float:
        """Return the next tick, now if it is one."""
        return math.ceil(time_s / self.limits.tick_s - 1e-6) * self.limits.tick_s


def playable(robot: Robot, table: GaitTable, limits: ValveLimits) -> GaitTable:
    """Return the table's gaits as a controller plays them, without those that valves cannot.

    Gaits that do not stand on whole ticks are rounded, and their steady motion is found anew.

    Raises
    ------
    InputError
        If no gait is left.
    """
    entries = [_on_ticks(robot, entry, table.model, limits) for entry in table.gaits]
    kept = tuple(entry for entry in entries if entry is not None)
    if not kept:
        raise InputError(
            f"no gait of the table holds its valves for {limits.dwell_s:g} s in whole ticks of "
            f"{limits.tick_s:g} s; make a table for these limits: python -m srs_opt.gait_opt --table "
            "--min-dwell S --tick S"
        )
    return table if kept == table.gaits else table.with_gaits(kept)


def _on_ticks(robot: Robot, entry: TableGait, model: str, limits: ValveLimits) -> TableGait | None:
    """Return an entry on whole ticks, None if it does not dwell or has no steady motion then."""
    times = [entry.gait.period_s, *entry.gait.switch_times_s()]
    if all(abs(t - round(t / limits.tick_s) * limits.tick_s) < 1e-6 * limits.tick_s for t in times):
        return entry if entry.gait.shortest_dwell_s() > limits.dwell_s - _SAME_S else None
    try:
        gait = entry.gait.on_ticks(limits.tick_s)
        if gait.shortest_dwell_s() < limits.dwell_s - _SAME_S:
            return None
        return TableGait.of_orbit(entry.name, steady_gait(robot, gait, model))
    except (InputError, NoAnswerError):  # an interval rounded away; no steady motion
        return None


@lru_cache(maxsize=4096)  # asked of a few gaits, for every gait that may come before or after
def _switches(intervals: tuple[Interval, ...]) -> tuple[int, tuple[float, ...]]:
    """Return a segment's valve state at the cycle's begin and its later switches in order (never none)."""
    inner = tuple(sorted(t for pair in intervals for t in pair if t > _SAME_S))
    on = any(start < _SAME_S for start, _ in intervals) or any(
        _SAME_S < end < start for start, end in intervals
    )
    return (1 if on else -1), inner


def gait_end(gait: Gait) -> tuple[list[int], list[float]]:
    """Return every segment's valve state at the cycle's end, and for how long it has stood."""
    states, ages = [], []
    for segment in range(gait.segments):
        begin, inner = _switches(gait.intervals[segment])
        states.append(begin if len(inner) % 2 == 0 else -begin)
        ages.append(gait.period_s - inner[-1])
    return states, ages


def intervals_of(first: int, switches: list[float]) -> tuple[Interval, ...]:
    """Return the on-intervals of a valve that begins a cycle in a state and switches at times inside it."""
    on = switches if first < 0 else [0.0, *switches]
    pairs = [(on[k], on[k + 1]) for k in range(0, len(on) - 1, 2)]
    if len(on) % 2 == 0:
        return tuple(pairs)
    # on at the end: until the next cycle, or wrapped onto the first interval
    if first > 0:
        return (*pairs[1:], (on[-1], pairs[0][1])) if pairs else ()
    return (*pairs, (on[-1], 0.0))


def _ramped(cycle: Timeline, from_kpa: float, ramp_s: float, stair_s: float | None) -> Timeline:
    """Return a cycle with the pressure's way from what it was: stairs through the middles of the ramp."""
    to_kpa = float(cycle.pressure_kpa[0])
    stairs = math.ceil(ramp_s / (stair_s or REGULATOR.stair_s) - 1e-9)
    ends = np.cumsum(cycle.duration_s)
    edges = np.concatenate([ramp_s / stairs * np.arange(stairs + 1), ends])
    edges.sort()
    edges = np.concatenate([edges[:1], edges[1:][edges[1:] - edges[:-1] > _SAME_S]])
    edges[-1] = ends[-1]
    middles = (edges[:-1] + edges[1:]) / 2
    phase = np.minimum(np.searchsorted(ends, middles), ends.size - 1)
    # the mean over every phase: exact to first order, also where a valve switches within a stair
    pressure = np.interp(middles, [0.0, ramp_s], [from_kpa, to_kpa])
    return Timeline(edges[1:] - edges[:-1], cycle.valve[:, phase], pressure, cycle.frequency_hz[phase])

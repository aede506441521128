"""Gaits: periodic valve timing at one pressure, as on-intervals per segment.

The paper's valve wave (13), S_i = sign(sin(omega t + beta_i) + phi_i), is exactly one interval of
S = +1 per segment and cycle; every other gait is a list of such intervals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from srs_opt.errors import InputError
from srs_opt.robot import Robot

Interval = tuple[float, float]
_COINCIDENT_S = 1e-9  # switches closer than this are one


@dataclass(frozen=True)
class Gait:
    """Periodic valve timing.

    Attributes
    ----------
    period_s, pressure_kpa : float
        Cycle time and the one regulator's pressure.
    intervals : tuple over segments (tail to head) of tuples of (on_s, off_s)
        S = +1 from on_s to off_s, both in [0, period), wrapping past the end allowed; S = -1 otherwise.
    """

    period_s: float
    pressure_kpa: float
    intervals: tuple[tuple[Interval, ...], ...]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.period_s) and self.period_s > 0):
            raise InputError(f"gait: period must be above 0 s, found {self.period_s}")
        if not (math.isfinite(self.pressure_kpa) and self.pressure_kpa >= 0):
            raise InputError(f"gait: pressure must be at least 0 kPa, found {self.pressure_kpa}")
        for i, intervals in enumerate(self.intervals, start=1):
            _check_intervals(i, intervals, self.period_s)

    def record(self) -> dict[str, Any]:
        """Return the gait as JSON holds it."""
        intervals = [[list(pair) for pair in pairs] for pairs in self.intervals]
        return {"period_s": self.period_s, "pressure_kpa": self.pressure_kpa, "intervals": intervals}

    @staticmethod
    def of_record(record: dict[str, Any]) -> Gait:
        """Return the gait of a record (which may hold more); InputError if it is none."""
        intervals = tuple(tuple((float(a), float(b)) for a, b in pairs) for pairs in record["intervals"])
        return Gait(float(record["period_s"]), float(record["pressure_kpa"]), intervals)

    @property
    def frequency_hz(self) -> float:
        """Cycles per second."""
        return 1 / self.period_s

    @property
    def segments(self) -> int:
        """Number of segments that the gait drives."""
        return len(self.intervals)

    @property
    def switches_per_s(self) -> float:
        """Valve switches per second, all segments together."""
        return 2 * sum(map(len, self.intervals)) / self.period_s

    def valve(self, time_s: float) -> np.ndarray:
        """Return the valve states at `time_s`, shape (N-1,), each +1 or -1."""
        t = time_s % self.period_s
        on = [any(_inside(t, a, b) for a, b in intervals) for intervals in self.intervals]
        return np.where(on, 1.0, -1.0)

    def switch_times_s(self) -> np.ndarray:
        """Return the sorted distinct switch times in [0, period)."""
        return np.array(self._switch_times())

    def _switch_times(self) -> list[float]:
        times = sorted(t for intervals in self.intervals for pair in intervals for t in pair)
        kept: list[float] = []
        for t in times:
            if not kept or t - kept[-1] > _COINCIDENT_S:
                kept.append(t)
        return kept

    def phases(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the cycle as phases of held valves: durations (n,) s and valve states (N-1, n).

        The first phase begins at time 0; durations add up to the period.
        """
        inner = [t for t in self._switch_times() if _COINCIDENT_S < t < self.period_s - _COINCIDENT_S]
        edges = [0.0, *inner, self.period_s]
        middles = [(a + b) / 2 for a, b in pairwise(edges)]
        # a handful of numbers: lists take a third of the time that arrays do
        valve = [
            [1.0 if any(_inside(t, on, off) for on, off in pairs) else -1.0 for t in middles]
            for pairs in self.intervals
        ]
        return np.array([b - a for a, b in pairwise(edges)]), np.array(valve)

    def shortest_dwell_s(self) -> float:
        """Return the shortest time for which any valve stays on or off (infinite without switches)."""
        shortest = math.inf
        for intervals in self.intervals:
            edges = sorted(intervals)
            for k, (on, off) in enumerate(edges):
                following = edges[(k + 1) % len(edges)][0]
                gap = (following - off) % self.period_s or self.period_s - (off - on) % self.period_s
                shortest = min(shortest, (off - on) % self.period_s, gap)
        return shortest

    def on_ticks(self, tick_s: float) -> Gait:
        """Return the gait with the period and every switch rounded to whole controller ticks."""
        ticks = max(round(self.period_s / tick_s), 2)
        period = ticks * tick_s
        scale = period / self.period_s

        def rounded(t: float) -> float:
            return round(t * scale / tick_s) % ticks * tick_s

        intervals = tuple(tuple((rounded(a), rounded(b)) for a, b in pairs) for pairs in self.intervals)
        return Gait(period, self.pressure_kpa, intervals)

    def mirrored(self) -> Gait:
        """Return the gait with left and right exchanged (it turns the other way)."""
        flipped = tuple(
            # where one chamber was off the other is on: from every off to the next on
            tuple((pairs[k - 1][1], pairs[k][0]) for k in range(len(pairs)))
            for pairs in (tuple(sorted(p)) for p in self.intervals)
        )
        return replace(self, intervals=flipped)

    def later(self, delay_s: float) -> Gait:
        """Return the gait with every switch later: the same motion, the cycle begun elsewhere."""

        def moved(t: float) -> float:
            # a rounding error before the end is the start of the cycle
            late = (t + delay_s) % self.period_s
            return 0.0 if late >= self.period_s - _COINCIDENT_S / 10 else late

        rows = tuple(tuple((moved(on), moved(off)) for on, off in pairs) for pairs in self.intervals)
        return replace(self, intervals=rows)

    def wave_phase_rad(self) -> float:
        """Return where in its cycle the body wave stands: the phase of the valves' first harmonic.

        Zero when the on-intervals of all segments together are centred on the cycle's begin.
        """
        turn = 2j * math.pi / self.period_s
        # the integral of exp(i omega t) over the on-intervals, i omega taken out
        harmonic = sum(
            np.exp(turn * off) - np.exp(turn * on) for pairs in self.intervals for on, off in pairs
        )
        return float(np.angle(harmonic / 1j))

    def reversed_wave(self) -> Gait:
        """Return the gait played backwards in time: the wave runs tail to head, the robot backs up."""
        period = self.period_s

        def back(t: float) -> float:
            reversed_time = period - t
            return reversed_time if reversed_time < period else 0.0

        flipped = tuple(tuple(sorted((back(off), back(on)) for on, off in pairs)) for pairs in self.intervals)
        return replace(self, intervals=flipped)


def check_gait(robot: Robot, gait: Gait) -> None:
    """Check that `robot` can play `gait`.

    Raises
    ------
    InputError
        If the gait drives another number of segments, or its pressure, held, would bend a segment by more
        than a full turn, where it meets itself.
    """
    if gait.segments != robot.segments:
        raise InputError(f"gait drives {gait.segments} segments, robot '{robot.name}' has {robot.segments}")
    most_kpa = robot.max_curvature_1_m / robot.curvature_per_pressure_1_m_kpa
    if gait.pressure_kpa > most_kpa:
        raise InputError(
            f"gait: a pressure of {gait.pressure_kpa:g} kPa bends a segment of robot '{robot.name}' by more "
            f"than a full turn; expected at most {most_kpa:.0f} kPa (is it given in Pa?)"
        )


def _inside(t: float, on: float, off: float) -> bool:
    return on <= t < off if on < off else (t >= on or t < off)


def _check_intervals(segment: int, intervals: tuple[Interval, ...], period_s: float) -> None:
    where = f"gait: segment {segment}"
    if not intervals:
        raise InputError(f"{where}: no on-interval; a valve that never switches keeps its segment bent")
    for on, off in intervals:
        if not (0 <= on < period_s and 0 <= off < period_s):
            raise InputError(f"{where}: switch times must lie in [0, {period_s:g}) s, found {on:g}, {off:g}")
        if on == off:
            raise InputError(f"{where}: interval at {on:g} s has no length")
    edges = sorted((on, off) if on < off else (on, off + period_s) for on, off in intervals)
    for (_, off), (on, _) in zip(edges, [*edges[1:], (edges[0][0] + period_s, 0.0)]):
        if len(edges) > 1 and off >= on:
            raise InputError(f"{where}: on-intervals overlap near {on % period_s:g} s")


@dataclass(frozen=True)
class Wave:
    """The paper's valve wave (13) with its own delay and offset per segment.

    Attributes
    ----------
    frequency_hz, pressure_kpa : float
    phase_rad, offset : tuple of N-1 floats, tail to head
        Delay beta_i and offset phi_i, |phi_i| < 1.
    """

    frequency_hz: float
    pressure_kpa: float
    phase_rad: tuple[float, ...]
    offset: tuple[float, ...]

    def __post_init__(self) -> None:
        values = (self.frequency_hz, self.pressure_kpa, *self.phase_rad, *self.offset)
        if not all(map(math.isfinite, values)):
            raise InputError("gait: frequency, pressure, phases and offsets must be finite numbers")
        if self.frequency_hz <= 0:
            raise InputError(f"gait: frequency must be above 0 Hz, found {self.frequency_hz:g}")
        if len(self.phase_rad) != len(self.offset):
            raise InputError(f"gait: {len(self.phase_rad)} phases but {len(self.offset)} offsets")
        for i, phi in enumerate(self.offset, start=1):
            if abs(phi) >= 1:
                raise InputError(
                    f"gait: offset of segment {i} is {phi:g}: with |offset| >= 1 its valve never switches, "
                    "so there is no steady gait; choose an offset between -1 and 1"
                )

    @staticmethod
    def uniform(
        segments: int, frequency_hz: float, pressure_kpa: float, phase_lag_rad: float, offset: float = 0.0
    ) -> Wave:
        """Return the wave with beta_i = lag * i (i from 1, tail to head) and one offset."""
        phases = tuple(phase_lag_rad * i for i in range(1, segments + 1))
        return Wave(frequency_hz, pressure_kpa, phases, (offset,) * segments)

    def gait(self) -> Gait:
        """Return the same gait as switch times: on at sin(omega t + beta) = -phi rising."""
        period = 1 / self.frequency_hz

        def time(angle: float) -> float:
            t = angle / (2 * math.pi) % 1.0 * period
            return 0.0 if t >= period - _COINCIDENT_S / 10 else t

        intervals = []
        for beta, phi in zip(self.phase_rad, self.offset):
            # sin(omega t + beta) > -phi from omega t = -a - beta to pi + a - beta
            a = math.asin(phi)
            intervals.append(((time(-a - beta), time(math.pi + a - beta)),))
        return Gait(period, self.pressure_kpa, tuple(intervals))


def published_wave(
    robot: Robot, frequency_hz: float = 2.0, pressure_kpa: float = 55.0, offset: float = 0.0
) -> Wave:
    """Return the paper's gait: delays beta_i = 2 pi i/(N-1) (Table 2)."""
    return Wave.uniform(robot.segments, frequency_hz, pressure_kpa, 2 * math.pi / robot.segments, offset)

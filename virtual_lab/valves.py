"""When the valves switch, in closed form."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from virtual_lab.trials import Trial

_LATE = 1e-9  # switches closer than this are one


def wave_switches(
    frequency_hz: float, lag_rad: float, offset: float, duration_s: float
) -> list[tuple[float, int]]:
    """Return (time, S from there on) of ``sign(sin(2 pi f t + lag) + offset)``, from time 0."""
    if abs(offset) >= 1.0:
        return [(0.0, 1 if offset > 0 else -1)]
    edge = math.asin(offset)
    start = 1 if math.sin(lag_rad) + offset >= 0 else -1
    found = []
    # sin(phase) = -offset at -edge (rising) and at pi + edge (falling)
    turns = frequency_hz * duration_s + lag_rad / (2 * math.pi)
    for phase, sign in ((-edge, 1), (math.pi + edge, -1)):
        for n in range(math.floor(lag_rad / (2 * math.pi)) - 2, math.ceil(turns) + 2):
            time = (phase + 2 * math.pi * n - lag_rad) / (2 * math.pi * frequency_hz)
            if abs(time) <= _LATE:
                start = sign
            elif 0 < time < duration_s:
                found.append((time, sign))
    return [(0.0, start), *sorted(found)]


def schedule_switches(
    intervals: Sequence[tuple[float, float]], period_s: float, duration_s: float
) -> list[tuple[float, int]]:
    """Return (time, S from there on) of a segment that is +1 in the given intervals of a period, else -1."""
    inside = any((-on) % period_s < (off - on) % period_s or off - on >= period_s for on, off in intervals)
    found = []
    for on, off in intervals:
        if off - on >= period_s:
            continue
        for n in range(-1, math.ceil(duration_s / period_s) + 1):
            found += [(on % period_s + n * period_s, 1), (off % period_s + n * period_s, -1)]
    return [(0.0, 1 if inside else -1), *sorted((t, s) for t, s in found if _LATE < t < duration_s)]


def segment_switches(trial: Trial, segment: int, duration_s: float) -> list[tuple[float, int]]:
    """Return (time, S from there on) of one segment (1 ... N-1), before any dead time."""
    if trial.kind == "still":
        return [(0.0, 0)]
    if trial.schedule is None:
        return wave_switches(trial.frequency_hz, trial.phase_lag_rad * segment, trial.offset, duration_s)
    intervals = [(on, off) for number, on, off in trial.schedule.entries if number == segment]
    if not intervals:
        return [(0.0, 0)]
    return schedule_switches(intervals, trial.schedule.period_s, duration_s)


def delayed(switches: Sequence[tuple[float, int]], delay_s: float) -> list[tuple[float, int]]:
    """Return the switches `delay_s` later, with S = 0 before."""
    if delay_s <= 0:
        return list(switches)
    return [(0.0, 0), *((time + delay_s, sign) for time, sign in switches)]


def slow_to_fill(switches: Sequence[tuple[float, int]], delay_s: float) -> list[tuple[float, int]]:
    """Return the switches with every +1 late by `delay_s`, lost when the -1 after it comes sooner."""
    late: list[tuple[float, int]] = []
    for n, (time, sign) in enumerate(switches):
        following = switches[n + 1][0] if n + 1 < len(switches) else math.inf
        if sign != 1:
            late.append((time, sign))
        elif time + delay_s < following:
            late += ([(0.0, 0)] if time == 0.0 else []) + [(time + delay_s, sign)]
    return late if late and late[0][0] == 0.0 else [(0.0, 0), *late]


def merge(per_segment: Sequence[Sequence[tuple[float, int]]], end_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the times at which any valve switches and every segment's S between them.

    Returns
    -------
    edges : (K+1,) array
        From 0 to `end_s`.
    sign : (K, N-1) array
    """
    times = np.unique([t for switches in per_segment for t, _ in switches if t < end_s])
    starts = times[np.append(True, np.diff(times) > _LATE)]
    sign = np.empty((len(starts), len(per_segment)))
    for column, switches in enumerate(per_segment):
        when = np.array([t for t, _ in switches])
        value = np.array([s for _, s in switches], dtype=float)
        sign[:, column] = value[np.searchsorted(when, starts + 2 * _LATE, side="right") - 1]
    return np.append(starts, end_s), sign

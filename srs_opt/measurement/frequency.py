"""The frequency at which the bends repeat, on the camera's clock: what a list of trials says is nominal."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from srs_opt.geometry import turning_angles
from srs_opt.measurement.records import Array
from srs_opt.measurement.take_settings import FREQUENCY


@dataclass(frozen=True)
class SeenFrequency:
    """A frequency with its standard deviation, Hz."""

    value_hz: float
    sd_hz: float

    def differs(self, nominal_hz: float, span_s: float) -> bool:
        """Whether it is not the nominal one, in a take of length `span_s`."""
        gap = abs(self.value_hz - nominal_hz)
        return gap > FREQUENCY.significant_sd * self.sd_hz and gap * span_s > FREQUENCY.least_phase


def seen_frequency(time_s: Array, tracks: Array, nominal_hz: float) -> SeenFrequency | None:
    """Return the frequency whose first harmonics leave least of the bends; None where that tells nothing.

    Parameters
    ----------
    time_s : ndarray, shape (T,)
        While the gait runs.
    tracks : ndarray, shape (T, M, 2)
        Markers along the robot, NaN where lost.
    nominal_hz : float
    """
    from scipy.optimize import minimize_scalar

    bends = turning_angles(tracks)
    signals = [(time_s[np.isfinite(b)], b[np.isfinite(b)]) for b in bends.T]
    signals = [
        (t, b)
        for t, b in signals
        if len(t) > 8 * FREQUENCY.harmonics and np.ptp(t) * nominal_hz > FREQUENCY.least_cycles
    ]
    if not signals or nominal_hz <= 0:
        return None

    def left(frequency: float) -> float:
        return sum(_left(t, b, frequency) for t, b in signals)

    span = max(float(np.ptp(t)) for t, _ in signals)
    # least squares has side minima one resolution 1/span apart: five points on each
    count = 2 * math.ceil(5 * FREQUENCY.searched_share * nominal_hz * span) + 1
    grid = nominal_hz * (1 + FREQUENCY.searched_share * np.linspace(-1, 1, max(count, 21)))
    cost = [left(f) for f in grid]
    k = int(np.argmin(cost))
    total = sum(float(((b - b.mean()) ** 2).sum()) for _, b in signals)
    if not 0 < k < len(grid) - 1 or cost[k] > FREQUENCY.most_left * total:
        return None
    options = {"xatol": 1e-7 * nominal_hz}
    found = minimize_scalar(left, bounds=(grid[k - 1], grid[k + 1]), method="bounded", options=options)
    step = 0.05 / span
    here = float(found.fun)
    # second derivative of the sum of squares: twice the information on the frequency, times the variance
    second = (left(found.x + step) + left(found.x - step) - 2 * here) / step**2
    values = sum(len(t) for t, _ in signals)
    # what is left is smooth in time: a cycle's samples count as two per harmonic
    independent = min(values, 2 * FREQUENCY.harmonics * span * nominal_hz * len(signals))
    variance = here / values * (values / independent)
    return SeenFrequency(float(found.x), math.sqrt(2 * variance / max(second, 1e-30)))


def far_frequency(time_s: Array, tracks: Array, nominal_hz: float) -> float | None:
    """Return the frequency of the bends where it is nowhere near the nominal one (to ask a person)."""
    bends = turning_angles(tracks)
    whole = bends[np.isfinite(bends).all(axis=1)]
    time = time_s[np.isfinite(bends).all(axis=1)]
    if len(time) < 8 * FREQUENCY.harmonics or not whole.size or not np.ptp(time) > 0:
        return None
    grid = np.arange(max(1.5 / np.ptp(time), nominal_hz / 5), 3 * nominal_hz, 0.1 / np.ptp(time))
    if not len(grid):
        return None
    cost = np.array([sum(_left(time, b, f) for b in whole.T) for f in (*grid, nominal_hz)])
    total = float(((whole - whole.mean(axis=0)) ** 2).sum())
    k = int(np.argmin(cost[:-1]))
    told = cost[k] < FREQUENCY.far_left * total and cost[-1] > FREQUENCY.most_left * total
    return float(grid[k]) if told else None


def _left(time_s: Array, bend: Array, frequency_hz: float) -> float:
    wave = 2 * np.pi * frequency_hz * time_s[:, None] * np.arange(1, FREQUENCY.harmonics + 1)
    basis = np.column_stack([np.sin(wave), np.cos(wave), np.ones_like(time_s)])
    best = np.linalg.lstsq(basis, bend, rcond=None)[0]
    return float(((bend - basis @ best) ** 2).sum())

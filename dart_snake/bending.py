"""What the actuators do: a chamber that fills and silicone that follows, one after the other.

Two first-order lags in series, x' = (C0 S - x)/tau_1 and kappa' = (x - kappa)/tau_2, give the step
response with two time constants. Between valve switches both are known in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_EQUAL = 1e-6  # relative difference below which the two time constants count as one


@dataclass(frozen=True)
class Lags:
    """State of all actuators: filling and curvature, (N-1,) each, 1/m."""

    filling: Array
    curvature: Array

    @staticmethod
    def rest(segments: int) -> Lags:
        """Return vented, straight actuators."""
        return Lags(np.zeros(segments), np.zeros(segments))


def respond(
    start: Lags, duration_s: Array, drive: Array, time_constants_s: tuple[float, float], times_s: Array
) -> tuple[Array, Array, Lags]:
    """Return curvatures (T, N-1) and their rates at `times_s`, and the state at the end.

    Parameters
    ----------
    start : Lags
    duration_s : (n,) array
        Of the phases in which the valves are held.
    drive : (n, N-1) array
        Curvature that each phase leads to, 1/m.
    time_constants_s : (tau_1, tau_2)
    times_s : (T,) array
        Increasing, from 0 to the end of the last phase.
    """
    first, second = time_constants_s
    if abs(first - second) < _EQUAL * second:
        first = second * (1 + _EQUAL)
    edges = np.concatenate([[0.0], np.cumsum(duration_s)])
    cuts = [0, *np.searchsorted(times_s, edges[1:-1]), times_s.size]
    curvature, rate = (np.empty((times_s.size, start.filling.size)) for _ in range(2))
    for k in range(duration_s.size):
        inside = slice(cuts[k], cuts[k + 1])
        _, curvature[inside], rate[inside] = _held(start, drive[k], first, second, times_s[inside] - edges[k])
        filling, bent, _ = _held(start, drive[k], first, second, duration_s[k : k + 1])
        start = Lags(filling[0], bent[0])
    return curvature, rate, start


def _held(start: Lags, drive: Array, first: float, second: float, t: Array) -> tuple[Array, Array, Array]:
    """Return filling, curvature and its rate, (T, N-1) each, at times since the valves were set."""
    quick, slow = np.exp(-t / first)[:, None], np.exp(-t / second)[:, None]
    missing = start.filling - drive
    filling = drive + missing * quick
    curvature = drive + (start.curvature - drive) * slow + missing * first / (first - second) * (quick - slow)
    return filling, curvature, (filling - curvature) / second

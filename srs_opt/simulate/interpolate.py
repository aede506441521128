"""Values between the nodes of a motion: piecewise linear, or cubic where the rates at the nodes are known."""

from __future__ import annotations

import numpy as np


def _interval(time_s: np.ndarray, at: np.ndarray, dimensions: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the node before each instant and the share of the way to the next, shaped for broadcasting.

    Of nodes at one time, as where motions were joined, the last counts.
    """
    k = np.clip(np.searchsorted(time_s, at, side="right") - 1, 0, time_s.size - 2)
    step = time_s[k + 1] - time_s[k]
    share = np.divide(at - time_s[k], step, out=np.ones(k.shape), where=step > 0).clip(0.0, 1.0)
    return k, share.reshape(-1, *[1] * (dimensions - 1))


def linear(time_s: np.ndarray, value: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return `value` (n, ...), given at `time_s` (n,), at instants (m,), held beyond the ends."""
    k, share = _interval(time_s, at, value.ndim)
    return np.asarray((1 - share) * value[k] + share * value[k + 1])


def linear_with_rate(time_s: np.ndarray, value: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what `linear` returns, and its derivative by time."""
    k, _ = _interval(time_s, at, value.ndim)
    step = (time_s[k + 1] - time_s[k]).reshape(-1, *[1] * (value.ndim - 1))
    return linear(time_s, value, at), np.asarray((value[k + 1] - value[k]) / step)


def hermite(time_s: np.ndarray, value: np.ndarray, rate: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Do what `linear` does, cubically, with the rates (n, ...) at the nodes: of fourth order."""
    k, u = _interval(time_s, at, value.ndim)
    h = (time_s[k + 1] - time_s[k]).reshape(u.shape)
    w = 1 - u
    left = w * w * ((1 + 2 * u) * value[k] + u * h * rate[k])
    right = u * u * ((1 + 2 * w) * value[k + 1] - w * h * rate[k + 1])
    return np.asarray(left + right)

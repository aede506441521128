"""How noisy tracks are, from the tracks alone."""

from __future__ import annotations

import math

import numpy as np

from srs_opt.measurement.records import Array

NORMAL_MAD = 0.6745  # median of |x| over the standard deviation of a normal distribution
FEWEST = 100  # differences from which on a median is worth comparing


def third_differences(points_m: Array) -> Array:
    """Return the finite third differences in time of tracks (T, ...), flat.

    A smooth motion hardly has any; of independent noise they have 1 + 9 + 9 + 1 = 20 times the variance.
    """
    third = np.diff(points_m.reshape(len(points_m), -1), n=3, axis=0)
    return np.asarray(third[np.isfinite(third)])


def noise_sd(points_m: Array) -> float:
    """Return the standard deviation of one coordinate's noise, robust against outliers; 0 of no samples."""
    third = third_differences(points_m)
    return float(np.median(np.abs(third)) / NORMAL_MAD / math.sqrt(20)) if len(third) else 0.0

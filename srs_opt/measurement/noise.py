"""How noisy tracks are, from the tracks alone."""

from __future__ import annotations

import math

import numpy as np

from srs_opt.measurement.records import Array

MAD = 0.674489750196  # median of |x| over the standard deviation of a normal distribution


def noise_sd(points_m: Array, fewest: int = 1) -> float:
    """Return the standard deviation of one coordinate's noise in tracks (T, ...), robust against outliers.

    From third differences in time: a smooth motion hardly has any, and of independent noise they have
    1 + 9 + 9 + 1 = 20 times the variance. 0 where there are fewer than `fewest` of them.
    """
    third = np.diff(points_m.reshape(len(points_m), -1), n=3, axis=0)
    third = third[np.isfinite(third)]
    return 0.0 if len(third) < fewest else float(np.median(np.abs(third)) / MAD / math.sqrt(20))

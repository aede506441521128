"""The mean of values that scatter by more than their own errors (random effects)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mean:
    """A weighted mean over tests: value, its standard deviation, scatter between tests beyond error."""

    value: float
    sd: float
    scatter: float
    tests: int


def weighted_mean(values: Array, sds: Array) -> Mean:
    """Return the mean of values that scatter by more than their own errors (DerSimonian and Laird, 1986)."""
    precision = np.asarray(sds, dtype=float) ** -2.0
    total = precision.sum()
    centre = float((precision * values).sum() / total)
    spare = len(values) - 1
    excess = 0.0
    if spare:
        chi2 = float((precision * (values - centre) ** 2).sum())
        # Cochran's Q less its expectation, over what unit scatter adds to it
        excess = max(0.0, (chi2 - spare) / float(total - (precision**2).sum() / total))
    weights = 1 / (np.asarray(sds) ** 2 + excess)
    value = float((weights * values).sum() / weights.sum())
    return Mean(value, float(weights.sum() ** -0.5), excess**0.5, len(values))

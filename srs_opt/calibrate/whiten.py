"""The linear map that makes a trial's noise white and of unit variance, for residuals and derivatives alike.

White noise and an Ornstein-Uhlenbeck process per coordinate: with a = exp(-dt/tau) the differences
u_i = y_i - a_i y_(i-1) have a tridiagonal covariance, whatever frames are missing, so that its Cholesky
factor has two diagonals and the map costs a few operations per value. Exact.
"""

from __future__ import annotations

import math

import numpy as np

from srs_opt.calibrate.noise import Noise


class Whitening:
    """The map for one trial's noise without its smooth terms.

    Parameters
    ----------
    noise : Noise
    time_s : array (T,)
    seen : array of bool (T, C)
        Which coordinates were measured.
    """

    def __init__(self, noise: Noise, time_s: np.ndarray, seen: np.ndarray) -> None:
        self.sd_m, self._shape = noise.white_sd_m, seen.shape
        self._correlated = noise.correlated_sd_m > 0
        if not self._correlated:
            self._rows = np.flatnonzero(seen.ravel())
            return
        from scipy.linalg import cholesky_banded

        channel, frame = np.nonzero(seen.T)
        # coordinate by coordinate, each in time: the process is one per coordinate
        self._rows = frame * seen.shape[1] + channel
        first = np.append(True, channel[1:] != channel[:-1])
        # where the next coordinate begins the difference is negative and not used: `keep` is 0 there
        lag = np.abs(np.diff(time_s[frame], prepend=0.0))
        # a = exp(-dt/tau), 0 at a coordinate's first value; var(u_i) = walk (1 - a^2) + white (1 + a^2), the
        # latter from both values, and cov(u_i, u_(i-1)) = -white a
        self._keep = np.where(first, 0.0, np.exp(-lag / noise.correlation_s))
        white, walk = noise.white_sd_m**2, noise.correlated_sd_m**2
        banded = np.empty((2, self._rows.size))
        banded[0] = walk * (1 - self._keep**2) + white * (1 + self._keep**2)
        banded[1, :-1], banded[1, -1] = -white * self._keep[1:], 0.0
        self._factor = cholesky_banded(banded, lower=True)

    @staticmethod
    def of_white(sd_m: float, values: np.ndarray) -> Whitening:
        """Return the map for white noise on a series of values (n,), NaN where lost."""
        return Whitening(Noise(sd_m), np.arange(float(values.size)), np.isfinite(values)[:, None])

    @property
    def log_det(self) -> float:
        """Log determinant of the covariance."""
        if self._correlated:
            # taking differences has determinant 1: only the Cholesky factor counts
            return float(2 * np.log(self._factor[0]).sum())
        return float(2 * self._rows.size * np.log(self.sd_m))

    def __call__(self, columns: np.ndarray) -> np.ndarray:
        """Return columns (T C, K) whitened, (seen, K)."""
        chosen = columns[self._rows]
        if not self._correlated:
            return np.asarray(chosen / self.sd_m)
        from scipy.linalg.lapack import dtbtrs

        # LAPACK's own order, or it would copy
        chosen = np.asfortranarray(chosen)
        differences = chosen.copy(order="F")
        differences[1:] -= self._keep[1:, None] * chosen[:-1]
        return np.asarray(dtbtrs(self._factor, differences, uplo="L", overwrite_b=1)[0])

    def in_place(self, whitened: np.ndarray) -> np.ndarray:
        """Return whitened values (seen,) where they were measured, (T, C), NaN elsewhere."""
        found = np.full(self._shape, np.nan)
        found.ravel()[self._rows] = whitened
        return found


def serial_correlation(values: np.ndarray, lags: int = 8) -> float:
    """Return the standardised sum of products of values (T, n) up to `lags` frames apart (NaN: lost)."""
    total, count = 0.0, 0
    for lag in range(1, min(lags, values.shape[0] - 1) + 1):
        products = values[lag:] * values[:-lag]
        seen = np.isfinite(products)
        total += float(products[seen].sum())
        count += int(seen.sum())
    return total / math.sqrt(count) if count else 0.0

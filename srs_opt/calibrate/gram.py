"""Normal equations of many trials, each with its own scatter, which is eliminated exactly.

One trial contributes [Y r]' [Y r]/sd^2 for slopes Y and residual r; its scatter b ~ N(0, P) acts through some
of the columns of Y. Eliminating b leaves a Gram matrix in the shared coordinates only, so that every question
about subsets of coordinates (scores, fits, cross-validation) is algebra on small matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class TrialGram:
    """One trial's normal equations, scatter not yet eliminated.

    Attributes
    ----------
    raw : array (K + 1, K + 1)
        [Y r]' [Y r]/sd^2; last row and column belong to the residual.
    count : int
        Number of measured values.
    scattered : tuple of int
        Columns through which the scatter acts.
    scatter_sd, scatter_now : array (B,)
        Prior of the scatter, and where it stood at the linearisation.
    serial : float
        Standardised sum of products of residuals a few frames apart (about unit normal for pure noise).
    stale : bool
        Whether the slopes are those of an earlier point.
    """

    raw: np.ndarray
    count: int
    scattered: tuple[int, ...]
    scatter_sd: np.ndarray
    scatter_now: np.ndarray
    serial: float = 0.0
    stale: bool = False

    @property
    def misfit(self) -> float:
        """Sum of squared residuals over the noise variance."""
        return float(self.raw[-1, -1])

    def eliminated(self, temper: float = 1.0) -> Eliminated:
        """Integrate the scatter out, the noise variance being `temper` times as large."""
        index = np.array(self.scattered, dtype=int)
        precision = self.scatter_sd**-2.0
        whole = self.raw / temper
        inner = whole[np.ix_(index, index)] + np.diag(precision)
        cross = whole[index].copy()
        cross[:, -1] -= self.scatter_now * precision
        back = np.linalg.solve(inner, cross)
        matrix = whole - cross.T @ back
        matrix[-1, -1] += float(np.sum(self.scatter_now**2 * precision))
        at_point = self.misfit / temper + float(np.sum(self.scatter_now**2 * precision))
        log_det = float(np.linalg.slogdet(inner)[1] - np.sum(np.log(precision)))
        return Eliminated(matrix, at_point, log_det, back)

    def only(self, columns: Sequence[int]) -> TrialGram:
        """Return the Gram matrix over some of the columns (all of the scatter's among them)."""
        keep = [*columns, self.raw.shape[0] - 1]
        scattered = tuple(keep.index(k) for k in self.scattered)
        raw = self.raw[np.ix_(keep, keep)]
        return TrialGram(raw, self.count, scattered, self.scatter_sd, self.scatter_now, self.serial)


@dataclass(frozen=True)
class Eliminated:
    """A trial's information on the shared coordinates.

    Attributes
    ----------
    matrix : array (K + 1, K + 1)
        Corner: the deviance at the best scatter.
    at_point : float
        Deviance where the scatter stands now.
    log_det : float
        Of the scatter's posterior precision over its prior's.
    back : array (B, K + 1)
        Scatter update = back[:, -1] - back[:, :-1] @ step.
    """

    matrix: np.ndarray
    at_point: float
    log_det: float
    back: np.ndarray


def trial_gram(
    residual: np.ndarray,
    slopes: np.ndarray,
    sd: float,
    scattered: Sequence[int],
    scatter_sd: np.ndarray,
    scatter_now: np.ndarray,
) -> TrialGram:
    """Return one trial's Gram matrix for residuals (n,), NaN where lost, and slopes (n, K)."""
    seen = np.isfinite(residual)
    both = np.column_stack([slopes[seen], residual[seen]]) / sd
    return TrialGram(both.T @ both, int(seen.sum()), tuple(scattered), scatter_sd, scatter_now)


@dataclass(frozen=True)
class Solution:
    """Least squares over a subset of coordinates.

    Attributes
    ----------
    step : array (k,)
    covariance : array (k, k)
    deviance : float
        At the minimum, priors included.
    """

    step: np.ndarray
    covariance: np.ndarray
    deviance: float


def solve(total: np.ndarray, chosen: Sequence[int], precision: np.ndarray, offset: np.ndarray) -> Solution:
    """Minimise the deviance over the coordinates `chosen`.

    Parameters
    ----------
    total : array (K + 1, K + 1)
        Sum of the trials' matrices.
    precision, offset : array (K,)
        Priors: precision and how far the point of linearisation lies above the prior's mean.
    """
    index = np.asarray(chosen, dtype=int)
    a = total[np.ix_(index, index)] + np.diag(precision[index])
    g = total[index, -1] - precision[index] * offset[index]
    scale = 1 / np.sqrt(np.maximum(np.diag(a), 1e-300))
    inverse = np.linalg.pinv(a * scale[:, None] * scale, rcond=1e-12, hermitian=True)
    inverse *= scale[:, None] * scale
    step = inverse @ g
    deviance = float(total[-1, -1] + np.sum(precision * offset**2) - g @ step)
    return Solution(step, inverse, deviance)


def bounded_solve(
    total: np.ndarray,
    chosen: Sequence[int],
    precision: np.ndarray,
    offset: np.ndarray,
    lower: np.ndarray,
) -> Solution:
    """Minimise as `solve` with steps not below `lower` (K,); the solution covers `chosen`."""
    chosen = list(chosen)
    held: dict[int, float] = {}
    free = list(chosen)
    while True:
        reduced, shifted = total, offset
        if held:
            step = np.zeros(total.shape[0])
            step[list(held)] = list(held.values())
            reduced = total.copy()
            reduced[:, -1] -= total @ step
            reduced[-1, -1] = total[-1, -1] - 2 * total[-1] @ step + step @ total @ step
            reduced[-1, :-1] = reduced[:-1, -1]
            shifted = offset + step[:-1]
        solution = solve(reduced, free, precision, shifted)
        low = {k: lower[k] for k, s in zip(free, solution.step) if s < lower[k] - 1e-12}
        if not low:
            break
        held.update(low)
        free = [k for k in free if k not in held]
    steps = {**held, **dict(zip(free, solution.step))}
    covariance = np.zeros((len(chosen), len(chosen)))
    inside = [chosen.index(k) for k in free]
    covariance[np.ix_(inside, inside)] = solution.covariance
    return Solution(np.array([steps[k] for k in chosen]), covariance, solution.deviance)

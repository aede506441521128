"""Normal equations of many trials, each with its own scatter, which is eliminated exactly.

One trial contributes [Y r]' [Y r]/sd^2 for Jacobian Y and residual r; its scatter b ~ N(0, P) acts through
some of the columns of Y. Eliminating b leaves a Gram matrix in the shared coordinates only, so that every
question about subsets of coordinates (scores, fits, cross-validation) is algebra on small matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from srs_opt.calibrate.fit_settings import OBJECTIVE
from srs_opt.calibrate.whiten import Whitening, serial_correlation


@dataclass(frozen=True)
class NormalEquations:
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
        Whether the derivatives are those of an earlier point.
    """

    raw: np.ndarray
    count: int
    scattered: tuple[int, ...]
    scatter_sd: np.ndarray
    scatter_now: np.ndarray
    serial: float = 0.0
    stale: bool = False
    _known: dict[float, Eliminated] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def misfit(self) -> float:
        """Sum of squared residuals over the noise variance."""
        return float(self.raw[-1, -1])

    def eliminated(
        self, inflation: float = 1.0, held: np.ndarray | None = None, damping: float = 0.0
    ) -> Eliminated:
        """Integrate the scatter out, the noise variance being `inflation` times as large.

        Parameters
        ----------
        held : array (B,), optional
            By how much the scatter moves where that is decided; NaN where it is free.
        damping : float
            Relative, on the scatter's own curvature: a damped step is short in the scatter too.
        """
        if held is not None or damping:
            return self._eliminate(inflation, held, damping)
        # screens, fits and tests ask for the same inflation again and again
        if inflation not in self._known:
            self._known[inflation] = self._eliminate(inflation, None, 0.0)
        return self._known[inflation]

    def _eliminate(self, inflation: float, held: np.ndarray | None, damping: float) -> Eliminated:
        # dtype: an empty list would become an index of floats
        index = np.array(self.scattered, dtype=int)
        precision = self.scatter_sd**-2.0
        whole = self.raw / inflation
        # precision of the scatter given everything else: data and prior
        inner = whole[np.ix_(index, index)] + np.diag(precision)
        cross = whole[index].copy()
        # the prior pulls the scatter back to zero from where it stands
        cross[:, -1] -= self.scatter_now * precision
        # Gaussian integral over b: log det (I + P Z'Z/sd^2), so that deviances of different models compare
        log_det = float(np.linalg.slogdet(inner)[1] - np.sum(np.log(precision)))
        at_point = self.misfit / inflation + float(np.sum(self.scatter_now**2 * precision))
        matrix = whole.copy()
        matrix[-1, -1] = at_point
        free = np.ones(index.size, dtype=bool)
        back = np.zeros_like(cross)
        if held is not None:
            free = np.isnan(held)
            move = np.where(free, 0.0, held)
            # the quadratic form where the held scatter has moved: its part of the gradient changes, too
            matrix[-1, -1] += move @ inner @ move - 2 * move @ cross[:, -1]
            matrix[:-1, -1] -= move @ cross[:, :-1]
            matrix[-1, :-1] = matrix[:-1, -1]
            cross[:, -1] -= inner @ move
            back[~free, -1] = move[~free]
        # Schur complement: what is left of the shared coordinates when the scatter follows them
        damped = inner + damping * np.diag(np.diag(inner))
        back[free] = np.linalg.solve(damped[np.ix_(free, free)], cross[free])
        matrix -= cross[free].T @ back[free]
        return Eliminated(matrix, at_point, log_det, back)

    def after(self, step: np.ndarray, moved: np.ndarray, inflation: float = 1.0) -> float:
        """Return the deviance that the linearisation promises after a step (K,), the scatter moved (B,)."""
        # the residual after a step is r - Y step, so [Y r] (step, -1) is minus that
        both = np.append(step, -1.0)
        both[list(self.scattered)] += moved
        scatter = (self.scatter_now + moved) / self.scatter_sd
        return float(both @ self.raw @ both) / inflation + float(scatter @ scatter)

    def length2(self, step: np.ndarray, moved: np.ndarray) -> float:
        """Return the square of what a step and a move change in the prediction, over the noise's."""
        both = step.copy()
        both[list(self.scattered)] += moved
        return float(both @ self.raw[:-1, :-1] @ both)

    def pull(self, step: np.ndarray, moved: np.ndarray, inflation: float = 1.0) -> np.ndarray:
        """Return minus half the gradient of `after` by the scatter (B,): where it is drawn."""
        both = np.append(step, -1.0)
        both[list(self.scattered)] += moved
        back = (self.scatter_now + moved) / self.scatter_sd**2
        return np.asarray(-(self.raw[list(self.scattered)] @ both) / inflation - back)

    def acceleration(
        self, ahead: NormalEquations, step: np.ndarray, moved: np.ndarray, share: float
    ) -> NormalEquations:
        """Return equations whose solution is the geodesic acceleration along a step and a move.

        Their residual is the second directional derivative of the prediction, by a finite difference: 2/s^2
        times (residual at s times the step, less what the first derivatives say), s the share.

        Parameters
        ----------
        ahead : NormalEquations
            With the derivatives of this point, the residuals of where `share` of the step leads.
        """
        both = step.copy()
        both[list(self.scattered)] += moved
        straight = self.raw[:-1, -1] - share * (self.raw[:-1, :-1] @ both)
        raw = self.raw.copy()
        raw[:-1, -1] = raw[-1, :-1] = 2 / share**2 * (ahead.raw[:-1, -1] - straight)
        return replace(self, raw=raw, scatter_now=np.zeros_like(self.scatter_now))

    def only(self, columns: Sequence[int]) -> NormalEquations:
        """Return the Gram matrix over some of the columns (all of the scatter's among them)."""
        keep = [*columns, self.raw.shape[0] - 1]
        scattered = tuple(keep.index(k) for k in self.scattered)
        raw = self.raw[np.ix_(keep, keep)]
        return NormalEquations(raw, self.count, scattered, self.scatter_sd, self.scatter_now, self.serial)


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


def trial_normal_equations(
    residual: np.ndarray,
    jacobian: np.ndarray,
    whiten: Whitening,
    scattered: Sequence[int],
    scatter_sd: np.ndarray,
    scatter_now: np.ndarray,
    own: np.ndarray | None = None,
    own_sd: np.ndarray | None = None,
) -> NormalEquations:
    """Return one trial's Gram matrix for residuals (n,) and derivatives (n, K), (T C) in a row.

    Parameters
    ----------
    own : array (n, Q), optional
        Columns of further unknowns of this trial alone, which are integrated out.
    own_sd : array (Q,), optional
        Priors of their amplitudes; infinite where nothing is known.
    """
    whole = [jacobian, residual[:, None]] if own is None else [jacobian, residual[:, None], own]
    both = whiten(np.concatenate(whole, axis=1))
    size = jacobian.shape[1] + 1
    raw = both.T @ both
    left = both[:, size - 1]
    if own is not None and own_sd is not None:
        # scaled to unit diagonal: shifts, turns and waves have sizes of their own
        scale = 1 / np.sqrt(np.maximum(np.diag(raw)[size:], 1e-300))
        inner = raw[size:, size:] * scale[:, None] * scale + np.diag((scale / own_sd) ** 2)
        # columns that were nowhere seen have no part in anything
        back = np.linalg.pinv(inner, rcond=OBJECTIVE.least_eigenvalue, hermitian=True) @ (
            scale[:, None] * raw[size:, :size]
        )
        left = left - both[:, size:] @ (scale * back[:, -1])
        raw = raw[:size, :size] - (scale[:, None] * raw[size:, :size]).T @ back
        # rounding leaves it not quite symmetric, which eigenvalue methods resent
        raw = (raw + raw.T) / 2
    # an unknown without a prior uses up one value (restricted likelihood)
    count = both.shape[0] - (0 if own_sd is None else int(np.sum(np.isinf(own_sd))))
    serial = serial_correlation(whiten.in_place(left))
    return NormalEquations(raw, count, tuple(scattered), scatter_sd, scatter_now, serial)


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


def scaled_inverse(matrix: np.ndarray) -> np.ndarray:
    """Return the pseudo-inverse of a Gram matrix, scaled to unit diagonal before its rank is judged.

    Without the scaling the rank would depend on the coordinates' units.
    """
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    both = scale[:, None] * scale
    return np.asarray(np.linalg.pinv(matrix * both, rcond=OBJECTIVE.least_eigenvalue, hermitian=True) * both)


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
    inverse = scaled_inverse(a)
    step = inverse @ g
    # the quadratic at its minimum, c - g' A^-1 g
    deviance = float(total[-1, -1] + np.sum(precision * offset**2) - g @ step)
    return Solution(step, inverse, deviance)


def bounded_solve(
    total: np.ndarray,
    chosen: Sequence[int],
    precision: np.ndarray,
    offset: np.ndarray,
    lower: np.ndarray,
) -> Solution:
    """Minimise as `solve` with steps not below `lower` (K,); the solution covers `chosen`.

    Coordinates that end at their bound have no covariance.
    """
    chosen = list(chosen)
    solution = solve(total, chosen, precision, offset)
    bound = lower[chosen]
    # mostly no bound is active
    if np.all(solution.step >= bound):
        return solution
    from scipy.optimize import lsq_linear

    a = total[np.ix_(chosen, chosen)] + np.diag(precision[chosen])
    g = total[chosen, -1] - precision[chosen] * offset[chosen]
    # a = F^T F turns the normal equations back into a least-squares problem, F y = z with F^T z = g. Scaled,
    # so that the rank is judged alike for all coordinates; directions without information are left out.
    scale = 1 / np.sqrt(np.maximum(np.diag(a), 1e-300))
    values, vectors = np.linalg.eigh(a * scale[:, None] * scale)
    kept = values > OBJECTIVE.least_eigenvalue * values[-1]
    root = np.sqrt(values[kept])
    factor = root[:, None] * vectors[:, kept].T
    target = (vectors[:, kept].T @ (scale * g)) / root
    bounds = bound / scale, np.full(len(chosen), np.inf)
    # an active-set method ends on the bounds themselves, an interior one only near
    found = lsq_linear(factor, target, bounds, method="bvls", tol=1e-14)
    free = [k for k, held in zip(chosen, found.active_mask) if held == 0]
    covariance = np.zeros((len(chosen), len(chosen)))
    inside = np.flatnonzero(found.active_mask == 0)
    covariance[np.ix_(inside, inside)] = solve(total, free, precision, offset).covariance
    # at the bound exactly, not a rounding error beyond it
    step = np.maximum(found.x * scale, bound)
    deviance = float(total[-1, -1] + np.sum(precision * offset**2) - 2 * g @ step + step @ a @ step)
    return Solution(step, covariance, deviance)

"""Step 3 (and 8): is there a gap beyond noise, scatter and what the fit can absorb?

After the fit the scores of further columns are N(0, S), S their Gram matrix with the fitted coordinates
projected out: priors and trial scatter included, and the refit too. The smallest p-value over all groups of
columns is compared with its distribution under that law (a parametric bootstrap), which holds the
familywise error whatever the groups share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.calibrate.normal_equations import scaled_inverse
from srs_opt.discrepancy.gap_settings import DETECTION


@dataclass(frozen=True)
class GroupScore:
    """One group's share of the gap.

    Attributes
    ----------
    improvement : float
        Drop of the deviance if the group's columns were added to the model.
    dof : int
    p_value : float
        Alone; see Detection for the family's.
    """

    improvement: float
    dof: int
    p_value: float


@dataclass(frozen=True)
class Detection:
    """What the tests say.

    Attributes
    ----------
    p_value : float
        Of the whole family.
    groups : tuple of GroupScore
    serial_p : float
        Of the residuals' autocorrelation alone.
    adjusted : tuple of float
        Family-adjusted p-value per group (single step).
    """

    p_value: float
    groups: tuple[GroupScore, ...]
    serial_p: float
    adjusted: tuple[float, ...]


def project(
    total: np.ndarray,
    fitted: Sequence[int],
    further: Sequence[int],
    precision: np.ndarray,
    offset: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return scores and covariance of `further` columns, the `fitted` ones projected out.

    Parameters
    ----------
    total : array (K + 1, K + 1)
        Sum of the trials' matrices; the last column belongs to the residual.
    precision, offset : array (len(fitted),)
        Priors of the fitted coordinates.
    """
    f, e = np.asarray(fitted), np.asarray(further)
    inverse = scaled_inverse(total[np.ix_(f, f)] + np.diag(precision))
    cross = total[np.ix_(e, f)]
    # s_e - C A^-1 s_f with A the fitted part, priors included: the refit is taken off both score and
    # covariance
    score = total[e, -1] - cross @ (inverse @ (total[f, -1] - precision * offset))
    covariance = total[np.ix_(e, e)] - cross @ inverse @ cross.T
    return score, (covariance + covariance.T) / 2


def with_shared(covariance: np.ndarray, sd: np.ndarray) -> np.ndarray:
    """Return the scores' covariance where columns also act at random, alike in all trials.

    Parameters
    ----------
    covariance : array (E, E)
        Of the noise alone, from `project`.
    sd : array (E,)
        Deviation of each column's coefficient; 0 for those that do not.
    """
    acting = sd > 0
    part = covariance[:, acting] * sd[acting]
    return np.asarray(covariance + part @ part.T)


def detect(
    score: np.ndarray,
    covariance: np.ndarray,
    groups: Sequence[Sequence[int]],
    serial: np.ndarray,
    rng: np.random.Generator,
) -> Detection:
    """Test all groups of columns, and the residuals' autocorrelation, together.

    Parameters
    ----------
    score, covariance : arrays (E,), (E, E)
        From `project`.
    groups : sequence of sequences of int
    serial : array
        Standardised autocorrelation of every trial.
    """
    from scipy.special import chdtrc, ndtr

    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    z, correlation = score / size, covariance / size[:, None] / size
    values, vectors = np.linalg.eigh(correlation)
    root = vectors * np.sqrt(np.maximum(values, 0))
    # all groups are tested on the same draws, so that what they share is accounted for
    drawn = rng.standard_normal((DETECTION.draws, z.size)) @ root.T
    observed, found = [], []
    largest: dict[int, np.ndarray] = {}  # of the drawn values, by the number of degrees of freedom
    for group in groups:
        whiten = _whiten(correlation[np.ix_(list(group), list(group))])
        dof = whiten.shape[1]
        value = float(np.sum((z[list(group)] @ whiten) ** 2))
        p = float(chdtrc(dof, value)) if dof else 1.0
        found.append(GroupScore(value, dof, p))
        observed.append(p)
        if dof:
            values = np.square(drawn[:, list(group)] @ whiten).sum(axis=1)
            # at equal degrees of freedom p falls with the value: only the largest can have the smallest p
            largest[dof] = np.maximum(largest.get(dof, 0.0), values)
    smallest = np.min(
        [np.ones(DETECTION.draws), *(chdtrc(dof, values) for dof, values in largest.items())], axis=0
    )
    # counting the data themselves among the draws: never 0, and valid for any number of draws
    adjusted = tuple(float((1 + np.sum(smallest <= p)) / (1 + smallest.size)) for p in observed)
    # one-sided: what a model lacks makes neighbouring frames alike, never opposite
    serial_p = float(ndtr(-serial.sum() / np.sqrt(max(serial.size, 1)))) if serial.size else 1.0
    # Bonferroni, with the level shared unequally: the autocorrelation sees little more than the groups
    whole = min(
        1.0, min([1.0, *(a / DETECTION.group_level for a in adjusted)]), serial_p / DETECTION.serial_level
    )
    return Detection(whole, tuple(found), serial_p, adjusted)


def _whiten(correlation: np.ndarray) -> np.ndarray:
    values, vectors = np.linalg.eigh(correlation)
    keep = values > DETECTION.least_eigenvalue * max(values[-1], 1e-300)
    # directions that rounding alone fills
    keep &= values > 1e-9
    return np.asarray(vectors[:, keep] / np.sqrt(values[keep]))

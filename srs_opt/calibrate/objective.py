"""What a fit makes small: misfit, priors, trial-to-trial scatter; and the step that the slopes ask for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.experiment import Point
from srs_opt.calibrate.gram import Solution, TrialGram, bounded_solve

CORRELATED = 100.0  # values of a track that a smooth misfit makes count as one


def priors(coordinates: Sequence[Coordinate], point: Point) -> tuple[np.ndarray, np.ndarray]:
    """Return precision and offset of the priors at `point`."""
    precision = np.array([0.0 if np.isinf(c.prior_sd) else c.prior_sd**-2 for c in coordinates])
    offset = np.array([point.values.get(c.name, c.start) - c.start for c in coordinates])
    return precision, offset


def misfit_ratio(grams: Mapping[str, TrialGram]) -> float:
    """Return the sum of squared residuals over its expectation under noise alone."""
    return sum(g.misfit for g in grams.values()) / sum(g.count for g in grams.values())


def temper_of(grams: Mapping[str, TrialGram], correlated: float = CORRELATED) -> float:
    """Return the factor on the noise variance that a misfit calls for.

    What a wrong model leaves behind is smooth in time and alike over the markers, so that `correlated` values
    count as one; without this, thousands of frames would pull the parameters far from their bench values.
    """
    count, ratio = sum(g.count for g in grams.values()), misfit_ratio(grams)
    return 1 + correlated * max(0.0, ratio - 1 - 4 * math.sqrt(2 / count))


def objective(
    coordinates: Sequence[Coordinate], grams: Mapping[str, TrialGram], point: Point, temper: float
) -> float:
    """Return -2 log posterior at `point` with the trials' scatter integrated out."""
    precision, offset = priors(coordinates, point)
    parts = [g.eliminated(temper) for g in grams.values()]
    return float(sum(e.at_point + e.log_det for e in parts) + precision @ offset**2)


def within_reach(
    coordinates: tuple[Coordinate, ...], grams: Mapping[str, TrialGram], point: Point, temper: float = 1.0
) -> float:
    """Return the deviance at the minimum that the linearisation promises."""
    log_det = sum(g.eliminated(temper).log_det for g in grams.values())
    return newton_step(coordinates, grams, point, temper).deviance + log_det


def excess_of(grams: Mapping[str, TrialGram]) -> float:
    """Return the misfit beyond what noise leaves."""
    return sum(max(g.misfit - g.count, 0.0) for g in grams.values())


def newton_step(
    coordinates: tuple[Coordinate, ...],
    grams: Mapping[str, TrialGram],
    point: Point,
    temper: float,
    damping: float = 0.0,
) -> Solution:
    """Solve for the step, holding coordinates that would leave their bounds at the bound."""
    precision, offset = priors(coordinates, point)
    now = np.array([point.values[c.name] for c in coordinates])
    lower = np.array([c.lower for c in coordinates])
    total = sum_eliminated(grams, temper)
    if damping:
        own = np.arange(len(coordinates))
        total[own, own] += damping * (total[own, own] + precision)
    return bounded_solve(total, range(len(coordinates)), precision, offset, lower - now)


def sum_eliminated(grams: Mapping[str, TrialGram], temper: float = 1.0) -> np.ndarray:
    """Return the sum of the trials' matrices, scatter integrated out."""
    return np.sum([g.eliminated(temper).matrix for g in grams.values()], axis=0)

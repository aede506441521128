"""Fit the model's coordinates to all trials at once: Gauss-Newton with priors and trial-to-trial scatter."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.experiment import Experiment, Extra, Point
from srs_opt.calibrate.gram import Solution, TrialGram, bounded_solve
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Trial

ITERATIONS = 12
CONVERGED = 0.1  # of the deviance
CORRELATED = 100.0  # values of a track that a smooth misfit makes count as one
LONGEST_LOG_STEP = 0.7
HOPELESS = 300.0  # deviance that even the linearisation promises to stay behind the one to beat
TRIED = 2  # iterations before that is believed
Report = Callable[[str], None]


class Measured(Protocol):
    """What a fit is held against."""

    def grams(
        self, point: Point, coordinates: Sequence[Coordinate], trials: Sequence[Trial] | None = None
    ) -> dict[str, TrialGram]:
        """Return the normal equations at `point`, by trial."""


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Attributes
    ----------
    coordinates : tuple of Coordinate
    point : Point
    covariance : array (K, K)
        Widened by the misfit that is left.
    deviance : float
        -2 log posterior at the point, trial scatter integrated out (up to a constant of the data).
    misfit_ratio : float
        Sum of squared residuals over its expectation under noise alone.
    temper : float
        By how much the noise variance was raised in the fit because the model does not explain the data.
    grams : dict
        Trial name -> TrialGram at the point.
    iterations : int
    converged : bool
    start_misfit_ratio : float
        As `misfit_ratio`, where the fit began.
    """

    coordinates: tuple[Coordinate, ...]
    point: Point
    covariance: np.ndarray
    deviance: float
    misfit_ratio: float
    temper: float
    grams: dict[str, TrialGram]
    iterations: int
    converged: bool
    start_misfit_ratio: float = math.nan

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviations by coordinate."""
        return {c.name: float(s) for c, s in zip(self.coordinates, np.sqrt(np.diag(self.covariance)))}


def start_point(coordinates: Sequence[Coordinate]) -> Point:
    """Return the coordinates' starting values, no scatter."""
    return Point({c.name: c.start for c in coordinates})


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


def fit(
    experiment: Measured,
    coordinates: Sequence[Coordinate],
    start: Point | None = None,
    trials: Sequence[Trial] | None = None,
    iterations: int = ITERATIONS,
    report: Report | None = None,
    beat: float = math.inf,
    correlated: float = CORRELATED,
) -> Fit:
    """Return the most probable values of `coordinates` given the trials.

    Parameters
    ----------
    start : Point, optional
        Where to begin; coordinates that it does not name begin at their own start.
    trials : sequence of Trial, optional
        Default: all of the experiment.
    beat : float
        A deviance; a fit that cannot come near it is not finished.
    correlated : float
        Values that a misfit makes count as one: see `temper_of`.

    Raises
    ------
    NoAnswerError
        If not even the starting point can be simulated.
    """
    coordinates = tuple(coordinates)
    point = start_point(coordinates)
    if start is not None:
        names = {c.name for c in coordinates}
        kept = {n: v for n, v in start.values.items() if n in names}
        point = Point({**point.values, **kept}, dict(start.scatter))
    grams = experiment.grams(point, coordinates, trials)
    at_start = misfit_ratio(grams)
    done, converged, damping, behind = 0, False, 0.0, math.inf
    while done < iterations and not converged:
        done += 1
        temper = temper_of(grams, correlated)
        now = objective(coordinates, grams, point, temper)
        moved = _moved(point, coordinates, grams, temper, damping)
        try:
            new_grams = experiment.grams(moved, coordinates, trials)
            new = objective(coordinates, new_grams, moved, temper)
        except NoAnswerError:
            new = math.inf
        gain = now - new
        if gain >= -(CONVERGED if temper < 3 else 5 * CONVERGED):
            enough = CONVERGED if temper < 3 else max(CONVERGED, 2e-3 * abs(now))
            converged = gain < enough and damping < 1
            point, grams = moved, new_grams
            damping = 0.0 if damping < 0.1 else damping * 0.1
        else:
            damping = max(damping * 10, 0.3)
            converged = damping > 1e4
        promised = within_reach(coordinates, grams, point)
        excess = promised - beat
        if done >= TRIED and excess > HOPELESS and excess > 0.5 * behind:
            break
        behind = excess
        missing = objective(coordinates, grams, point, 1.0) - promised
        converged |= temper_of(grams, correlated) == 1 and missing < CONVERGED
        if report is not None:
            report(f"misfit {sum(g.misfit for g in grams.values()):.0f}")
    temper = temper_of(grams, correlated)
    return Fit(
        coordinates,
        point,
        _step(coordinates, grams, point, temper, 0.0).covariance,
        objective(coordinates, grams, point, 1.0),
        misfit_ratio(grams),
        temper,
        grams,
        done,
        converged,
        at_start,
    )


def objective(
    coordinates: Sequence[Coordinate], grams: Mapping[str, TrialGram], point: Point, temper: float
) -> float:
    """Return -2 log posterior at `point` with the trials' scatter integrated out."""
    precision, offset = priors(coordinates, point)
    parts = [g.eliminated(temper) for g in grams.values()]
    return float(sum(e.at_point + e.log_det for e in parts) + precision @ offset**2)


def within_reach(coordinates: tuple[Coordinate, ...], grams: Mapping[str, TrialGram], point: Point) -> float:
    """Return the deviance at the minimum that the linearisation promises."""
    log_det = sum(g.eliminated().log_det for g in grams.values())
    return _step(coordinates, grams, point, 1.0, 0.0).deviance + log_det


def _step(
    coordinates: tuple[Coordinate, ...],
    grams: Mapping[str, TrialGram],
    point: Point,
    temper: float,
    damping: float,
) -> Solution:
    """Solve for the step, holding coordinates that would leave their bounds at the bound."""
    total = sum_eliminated(grams, temper)
    precision, offset = priors(coordinates, point)
    if damping:
        own = np.arange(len(coordinates))
        total[own, own] += damping * (total[own, own] + precision)
    now = np.array([point.values[c.name] for c in coordinates])
    lower = np.array([c.lower for c in coordinates])
    return bounded_solve(total, range(len(coordinates)), precision, offset, lower - now)


def _moved(
    point: Point,
    coordinates: tuple[Coordinate, ...],
    grams: Mapping[str, TrialGram],
    temper: float,
    damping: float,
) -> Point:
    step = _step(coordinates, grams, point, temper, damping).step
    values = dict(point.values)
    for coordinate, s in zip(coordinates, step):
        reach = LONGEST_LOG_STEP if not coordinate.effect or "log_" in coordinate.name else math.inf
        values[coordinate.name] += float(np.clip(s, -reach, reach))
    scatter = dict(point.scatter)
    for name, gram in grams.items():
        back = gram.eliminated(temper).back
        now = scatter.get(name, np.zeros(back.shape[0]))
        limit = 5 * gram.scatter_sd
        scatter[name] = np.clip(now + back[:, -1] - back[:, :-1] @ step, -limit, limit)
    return Point(values, scatter)


def sum_eliminated(grams: Mapping[str, TrialGram], temper: float = 1.0) -> np.ndarray:
    """Return the sum of the trials' matrices, scatter integrated out."""
    return np.sum([g.eliminated(temper).matrix for g in grams.values()], axis=0)


__all__ = ["Experiment", "Extra", "Fit", "Measured", "Point", "fit"]

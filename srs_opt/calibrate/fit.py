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
CONVERGED = 0.05  # of the deviance: a fifth of a standard deviation
CORRELATED = 100.0  # values of a track that a smooth misfit makes count as one
LONGEST_LOG_STEP = 0.7
HOPELESS = 300.0  # deviance that even the linearisation promises to stay behind the one to beat
TRIED = 2  # iterations before that is believed
TRUSTED = 0.25  # of the gain that slopes promise: with no larger error they serve for the next step too
FAR_OFF = 3.0  # temper from which on a fit does not explain the data
IDLE, MOST_DAMPING = 2, 1e4  # steps that gain nothing, and damping, at which a fit is given up
TAKEN_BACK = (0.5, 0.2, 0.0)  # parts of a step that a trial's scatter may go instead
FEW_ASTRAY = 3  # where no more than a third of the trials went astray: else the step was too long
JITTER = 2e-5  # deviance per measured value that a new mesh of the integration may cost
Report = Callable[[str], None]


class Measured(Protocol):
    """What a fit is held against."""

    @property
    def trials(self) -> Sequence[Trial]:
        """Return all that there are."""

    def grams(
        self,
        point: Point,
        coordinates: Sequence[Coordinate],
        trials: Sequence[Trial] | None = None,
        *,
        stale: bool = False,
    ) -> dict[str, TrialGram]:
        """Return the normal equations at `point`, by trial; `stale` allows slopes of an earlier point."""


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
        Whether the linearisation at the point promises to gain next to nothing, all trials asked.
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
    near: float = 0.0,
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
    near : float
        Share of the misfit beyond the noise that a fit far off may leave to be gained and still count as
        converged: what does not explain the data need not be known well.

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
    trials = experiment.trials if trials is None else trials
    grams = experiment.grams(point, coordinates, trials)
    at_start = misfit_ratio(grams)
    done, idle, converged, damping, behind = 0, 0, False, 0.0, math.inf
    while True:
        temper = temper_of(grams, correlated)
        now = objective(coordinates, grams, point, temper)
        stale = any(g.stale for g in grams.values())
        enough = max(CONVERGED, near * _excess(grams) / temper) if temper > FAR_OFF else CONVERGED
        missing = now - within_reach(coordinates, grams, point, temper)
        jitter = max(CONVERGED, JITTER * sum(g.count for g in grams.values()) / temper)
        if missing < enough:
            if not stale:
                converged = True
                break
            grams = experiment.grams(point, coordinates, trials)
            continue
        if done >= iterations or idle >= IDLE or damping > MOST_DAMPING:
            converged = missing < jitter and not stale
            break
        done += 1
        moved, promised = _moved(point, coordinates, grams, temper, damping)
        try:
            new_grams = experiment.grams(moved, coordinates, trials, stale=True)
            moved = _tamed(experiment, coordinates, trials, (point, grams), (moved, new_grams), temper)
            gain = now - objective(coordinates, new_grams, moved, temper)
        except NoAnswerError:
            gain = -math.inf
        if gain > -jitter:
            idle = idle + 1 if gain < CONVERGED and damping < 1 and not stale else 0
            point, grams = moved, new_grams
            damping = 0.0 if damping < 0.02 else damping * 0.3
            if abs(gain - promised) > TRUSTED * promised:
                grams = experiment.grams(point, coordinates, trials)
        elif stale:
            grams = experiment.grams(point, coordinates, trials)
        else:
            damping = max(damping * 4, 0.1)
        excess = within_reach(coordinates, grams, point) - beat
        if done >= TRIED and excess > HOPELESS and excess > 0.5 * behind:
            break
        behind = excess
        if report is not None:
            report(f"misfit {sum(g.misfit for g in grams.values()):.0f}")
    if any(g.stale for g in grams.values()):
        grams = experiment.grams(point, coordinates, trials)
    temper = temper_of(grams, correlated)
    return Fit(
        coordinates,
        point,
        _step(coordinates, grams, point, temper).covariance,
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


def within_reach(
    coordinates: tuple[Coordinate, ...], grams: Mapping[str, TrialGram], point: Point, temper: float = 1.0
) -> float:
    """Return the deviance at the minimum that the linearisation promises."""
    log_det = sum(g.eliminated(temper).log_det for g in grams.values())
    return _step(coordinates, grams, point, temper).deviance + log_det


def _excess(grams: Mapping[str, TrialGram]) -> float:
    """Return the misfit beyond what noise leaves."""
    return sum(max(g.misfit - g.count, 0.0) for g in grams.values())


def _step(
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


def _moved(
    point: Point,
    coordinates: tuple[Coordinate, ...],
    grams: Mapping[str, TrialGram],
    temper: float,
    damping: float,
) -> tuple[Point, float]:
    """Return the point after a step within reason, and the deviance that it promises to gain."""
    step = _step(coordinates, grams, point, temper, damping).step
    for k, c in enumerate(coordinates):
        if not c.effect or "log_" in c.name:
            step[k] = np.clip(step[k], -LONGEST_LOG_STEP, LONGEST_LOG_STEP)
    parts = {name: g.eliminated(temper) for name, g in grams.items()}
    scatter = dict(point.scatter)
    for name, gram in grams.items():
        back = parts[name].back
        now = scatter.get(name, np.zeros(back.shape[0]))
        limit = 5 * gram.scatter_sd
        scatter[name] = np.clip(now + back[:, -1] - back[:, :-1] @ step, -limit, limit)
    precision, offset = priors(coordinates, point)
    both = np.append(step, -1.0)
    gain = sum(e.at_point - float(both @ e.matrix @ both) for e in parts.values())
    gain += float(precision @ (offset**2 - (offset + step) ** 2))
    values = dict(point.values)
    for coordinate, s in zip(coordinates, step):
        values[coordinate.name] += float(s)
    return Point(values, scatter), gain


def _tamed(
    experiment: Measured,
    coordinates: tuple[Coordinate, ...],
    trials: Sequence[Trial],
    before: tuple[Point, Mapping[str, TrialGram]],
    after: tuple[Point, dict[str, TrialGram]],
    temper: float,
) -> Point:
    """Return the new point with the scatter of trials that went astray taken back; their matrices follow.

    A trial's scatter is its own affair: one near a change of its gait, which follows far less linearly than
    the others, must not hold up the fit to all.
    """
    (point, grams), (moved, new_grams) = before, after
    step = [moved.values[c.name] - point.values[c.name] for c in coordinates]
    both = np.append(step, -1.0)

    def own(gram: TrialGram) -> float:
        return gram.misfit / temper + float(np.sum((gram.scatter_now / gram.scatter_sd) ** 2))

    allowed = {}
    for name in {t.name for t in trials} & grams.keys():
        gram = grams[name]
        expected = float(both @ gram.eliminated(temper).matrix @ both)
        allowed[name] = expected + 1 + JITTER * gram.count / temper + TRUSTED * abs(own(gram) - expected)
    scatter = dict(moved.scatter)
    for part in TAKEN_BACK:
        astray = [t for t in trials if t.name in allowed and own(new_grams[t.name]) > allowed[t.name]]
        if not 0 < len(astray) <= len(allowed) // FEW_ASTRAY:
            break
        tried = dict(scatter)
        for t in astray:
            now = point.scatter.get(t.name, np.zeros_like(grams[t.name].scatter_sd))
            tried[t.name] = now + part * (moved.scatter[t.name] - now)
        found = experiment.grams(Point(moved.values, tried), coordinates, astray, stale=True)
        for t in astray:
            if own(found[t.name]) < own(new_grams[t.name]):
                new_grams[t.name], scatter[t.name] = found[t.name], tried[t.name]
    return Point(moved.values, scatter)


def sum_eliminated(grams: Mapping[str, TrialGram], temper: float = 1.0) -> np.ndarray:
    """Return the sum of the trials' matrices, scatter integrated out."""
    return np.sum([g.eliminated(temper).matrix for g in grams.values()], axis=0)


__all__ = ["Experiment", "Extra", "Fit", "Measured", "Point", "fit"]

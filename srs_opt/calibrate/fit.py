"""Fit the model's coordinates to all trials at once: Gauss-Newton with priors and trial-to-trial scatter."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from srs_opt.calibrate.coordinates import SCATTER_SD, Coordinate
from srs_opt.calibrate.gram import Solution, TrialGram, bounded_solve, trial_gram
from srs_opt.calibrate.instruments import NAME, reading_gram, readings
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.noise import track_of
from srs_opt.calibrate.nominal import Nodes, TrialRun, tolerance_for
from srs_opt.calibrate.observe import Prediction, predict
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Bench, Trial
from srs_opt.simulate.together import together

if TYPE_CHECKING:
    from srs_opt.calibrate.crew import Crew

ITERATIONS = 12
CONVERGED = 0.1  # of the deviance
CORRELATED = 100.0  # values that a smooth misfit makes count as one
LONGEST_LOG_STEP = 0.7
HOPELESS = 300.0  # deviance that even the linearisation promises to stay behind the one to beat
TRIED = 2  # iterations before that is believed
Report = Callable[[str], None]
Extra = Callable[[Trial, Prediction], np.ndarray]


@dataclass(frozen=True)
class Point:
    """Where a model stands: shared coordinates and every trial's scatter.

    Attributes
    ----------
    values : dict
        Coordinate -> value.
    scatter : dict
        Trial name -> array of log factors on friction along, across and curvature.
    """

    values: dict[str, float]
    scatter: dict[str, np.ndarray] = field(default_factory=dict)

    def of_trial(self, name: str) -> dict[str, float]:
        """Return the values with the trial's own scatter added."""
        own = dict(self.values)
        for parameter, b in zip(SCATTER_SD, self.scatter.get(name, np.zeros(len(SCATTER_SD)))):
            own[parameter] = own.get(parameter, 0.0) + float(b)
        return own


class Experiment:
    """The trials of a data set and the model that is held against them.

    Parameters
    ----------
    model : Model
    trials : sequence of Trial
    sd_m : float
        Noise per coordinate.
    bench : Bench, optional
        Readings of other instruments to hold the model against too.
    tolerance_m_s : float, optional
        Of the simulation; default: what the trials' number of values asks for.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        sd_m: float,
        bench: Bench | None = None,
        tolerance_m_s: float | None = None,
    ) -> None:
        self.model, self.trials, self.sd_m = model, tuple(trials), sd_m
        self.readings = readings(model, bench) if bench is not None else ()
        self.runs = {t.name: TrialRun(model, t) for t in self.trials}
        self.tracks = {t.name: track_of(t) for t in self.trials}
        count = sum(track.size for track in self.tracks.values() if track is not None)
        self.tolerance_m_s = tolerance_m_s or tolerance_for(count, sd_m)
        self.scatter_sd = np.array(list(SCATTER_SD.values()))
        self.crew: Crew | None = None

    def predict(
        self,
        trial: Trial,
        point: Point,
        coordinates: Sequence[Coordinate] = (),
        tolerance_m_s: float | None = None,
    ) -> Prediction:
        """Return the prediction of one trial at `point`."""
        nodes = self.runs[trial.name](point.of_trial(trial.name), tolerance_m_s or self.tolerance_m_s)
        return self._seen(trial, nodes, point, coordinates)

    def _seen(
        self, trial: Trial, nodes: Nodes, point: Point, coordinates: Sequence[Coordinate]
    ) -> Prediction:
        values = point.of_trial(trial.name)
        centre_only = trial.markers_m is None
        return predict(self.model, trial, nodes, values, coordinates, centre_only=centre_only)

    def residual(self, trial: Trial, prediction: Prediction) -> np.ndarray:
        """Return measured minus predicted, (T, 2 M)."""
        track = self.tracks[trial.name]
        assert track is not None
        return np.asarray(track - prediction.points)

    def gram(
        self,
        trial: Trial,
        point: Point,
        coordinates: Sequence[Coordinate],
        extra: Extra | None = None,
    ) -> TrialGram:
        """Return the trial's Gram matrix over `coordinates`, then the residual functions `extra`.

        The coordinates must include the scattering parameters.
        """
        return self.own_grams((trial,), point, coordinates, extra)[trial.name]

    def own_grams(
        self,
        trials: Sequence[Trial],
        point: Point,
        coordinates: Sequence[Coordinate],
        extra: Extra | None = None,
    ) -> dict[str, TrialGram]:
        """Return the Gram matrices of `trials`, simulated side by side in this process."""
        nodes = together(
            [self.runs[t.name].search(point.of_trial(t.name), self.tolerance_m_s) for t in trials]
        )
        found = {}
        for trial, run in zip(trials, nodes):
            if isinstance(run, NoAnswerError):
                raise run
            found[trial.name] = self._gram(trial, run, point, coordinates, extra)
        return found

    def _gram(
        self,
        trial: Trial,
        nodes: Nodes,
        point: Point,
        coordinates: Sequence[Coordinate],
        extra: Extra | None,
    ) -> TrialGram:
        prediction = self._seen(trial, nodes, point, coordinates)
        residual = self.residual(trial, prediction)
        slopes = prediction.slopes.reshape(residual.size, -1)
        if extra is not None:
            slopes = np.column_stack([slopes, extra(trial, prediction).reshape(residual.size, -1)])
        names = [c.name for c in coordinates]
        scattered = [names.index(n) for n in SCATTER_SD]
        now = point.scatter.get(trial.name, np.zeros(len(SCATTER_SD)))
        gram = trial_gram(residual.ravel(), slopes, self.sd_m, scattered, self.scatter_sd, now)
        return replace(gram, serial=serial_correlation(residual / self.sd_m))

    def grams(
        self,
        point: Point,
        coordinates: Sequence[Coordinate],
        trials: Sequence[Trial] | None = None,
        extra: Extra | None = None,
    ) -> dict[str, TrialGram]:
        """Return the Gram matrices of several trials."""
        chosen = self.trials if trials is None else trials
        if self.crew is not None:
            found = self.crew.grams(chosen, point, coordinates, extra)
        else:
            found = self.own_grams(chosen, point, coordinates, extra)
        if self.readings and found:
            further = next(iter(found.values())).raw.shape[0] - 1 - len(coordinates)
            found[NAME] = reading_gram(self.readings, point.values, coordinates, further)
        return found


def serial_correlation(residual: np.ndarray, lags: int = 8) -> float:
    """Return the standardised sum of products of residuals (T, n) up to `lags` frames apart (NaN: lost)."""
    total, count = 0.0, 0
    for lag in range(1, min(lags, residual.shape[0] - 1) + 1):
        products = residual[lag:] * residual[:-lag]
        seen = np.isfinite(products)
        total += float(products[seen].sum())
        count += int(seen.sum())
    return total / math.sqrt(count) if count else 0.0


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


def temper_of(grams: Mapping[str, TrialGram]) -> float:
    """Return the factor on the noise variance that a misfit calls for.

    What a wrong model leaves behind is smooth in time and alike over the markers, so that CORRELATED values
    count as one; without this, thousands of frames would pull the parameters far from their bench values.
    """
    count, ratio = sum(g.count for g in grams.values()), misfit_ratio(grams)
    return 1 + CORRELATED * max(0.0, ratio - 1 - 4 * math.sqrt(2 / count))


def fit(
    experiment: Experiment,
    coordinates: Sequence[Coordinate],
    start: Point | None = None,
    trials: Sequence[Trial] | None = None,
    iterations: int = ITERATIONS,
    report: Report | None = None,
    beat: float = math.inf,
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
        temper = temper_of(grams)
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
        if temper_of(grams) == 1 and objective(coordinates, grams, point, 1.0) - promised < CONVERGED:
            converged = True
        if report is not None:
            report(f"misfit {sum(g.misfit for g in grams.values()):.0f}")
    temper = temper_of(grams)
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

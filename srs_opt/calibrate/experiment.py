"""The trials of a data set held against the model: predictions, residuals, normal equations."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from srs_opt.calibrate.coordinates import SCATTER_SD, Coordinate
from srs_opt.calibrate.gram import TrialGram, trial_gram
from srs_opt.calibrate.instruments import NAME, reading_gram, readings
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.noise import track_of
from srs_opt.calibrate.nominal import Nodes, TrialRun, tolerance_for
from srs_opt.calibrate.observe import Prediction, predict
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Bench, Trial
from srs_opt.simulate.together import together

if TYPE_CHECKING:
    from srs_opt.calibrate.cluster import ClusterCrew
    from srs_opt.calibrate.crew import Crew

AT_ONCE = 48  # trials whose motions are in memory together: enough to fill the lanes
ROUGHER = 5.0  # times the tolerance, for fits whose misfit hides it
MOST_KEPT = 2_000_000  # measured values up to which slopes and motions are kept: some 300 MB
Extra = Callable[[Trial, Prediction], np.ndarray]
Slopes = tuple[tuple[str, ...], np.ndarray]  # coordinates, and a trial's slopes (n, K) in single precision


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


@dataclass(frozen=True)
class Request:
    """What is asked of the trials.

    Attributes
    ----------
    point : Point
    coordinates : tuple of Coordinate
        By which the motions are derived; the scattering parameters are among them.
    extra : callable, optional
        Residual functions, as further columns.
    stale : bool
        Whether slopes of the last request for the same coordinates serve.
    rough : bool
        Whether the motions need not be better than a model can say that leaves a plain misfit.
    """

    point: Point
    coordinates: tuple[Coordinate, ...]
    extra: Extra | None = None
    stale: bool = False
    rough: bool = False


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
    keeps : bool, optional
        Whether slopes and motions are kept for the next request; default: while they fit into memory.
    """

    def __init__(
        self,
        model: Model,
        trials: Sequence[Trial],
        sd_m: float,
        bench: Bench | None = None,
        tolerance_m_s: float | None = None,
        keeps: bool | None = None,
    ) -> None:
        self.model, self.trials, self.sd_m = model, tuple(trials), sd_m
        self.readings = readings(model, bench) if bench is not None else ()
        self.runs = {t.name: TrialRun(model, t) for t in self.trials}
        self.tracks = {t.name: track_of(t) for t in self.trials}
        count = sum(track.size for track in self.tracks.values() if track is not None)
        self.tolerance_m_s = tolerance_m_s or tolerance_for(count, sd_m)
        self.keeps = count <= MOST_KEPT if keeps is None else keeps
        self.slopes: dict[str, Slopes] = {}
        self._motions: dict[str, tuple[bool, dict[str, float], Nodes]] = {}
        self.scatter_sd = np.array(list(SCATTER_SD.values()))
        self.crew: Crew | ClusterCrew | None = None

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

    def predictions(self, trials: Sequence[Trial], point: Point) -> list[Prediction]:
        """Return the predictions of several trials at `point`, simulated side by side."""
        return [self._seen(t, nodes, point, ()) for t, nodes in zip(trials, self._simulated(trials, point))]

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

    def own_grams(self, trials: Sequence[Trial], request: Request) -> dict[str, TrialGram]:
        """Return the Gram matrices of `trials`, simulated side by side in this process."""
        found = {}
        for first in range(0, len(trials), AT_ONCE):
            some = trials[first : first + AT_ONCE]
            for trial, nodes in zip(some, self._simulated(some, request.point, rough=request.rough)):
                found[trial.name] = self._gram(trial, nodes, request)
        return found

    def _simulated(self, trials: Sequence[Trial], point: Point, *, rough: bool = False) -> list[Nodes]:
        """Return the trials' motions at `point`; one that was simulated there last is not simulated anew."""
        default = self.model.default
        wanted = {
            t.name: {k: v for k, v in point.of_trial(t.name).items() if v != default(k)} for t in trials
        }
        last = {n: self._motions.get(n) for n in wanted}
        known = {n: m[2] for n, m in last.items() if m is not None and m[:2] == (rough, wanted[n])}
        names = [n for n in wanted if n not in known]
        tolerance = self.tolerance_m_s * (ROUGHER if rough else 1.0)
        searches = [self.runs[n].search(point.of_trial(n), tolerance) for n in names]
        for name, nodes in zip(names, together(searches)):
            if isinstance(nodes, NoAnswerError):
                raise nodes
            known[name] = nodes
            if self.keeps:
                self._motions[name] = rough, wanted[name], nodes
        return [known[n] for n in wanted]

    def _gram(self, trial: Trial, nodes: Nodes, request: Request) -> TrialGram:
        point, extra = request.point, request.extra
        names = tuple(c.name for c in request.coordinates)
        kept = self.slopes.get(trial.name)
        stale = request.stale and kept is not None and kept[0] == names
        prediction = self._seen(trial, nodes, point, () if stale else request.coordinates)
        residual = self.residual(trial, prediction)
        if stale:
            assert kept is not None
            slopes = kept[1]
        else:
            slopes = prediction.slopes.reshape(residual.size, -1)
            if self.keeps and extra is None:
                self.slopes[trial.name] = names, slopes.astype(np.float32)
        if extra is not None:
            slopes = np.column_stack([slopes, extra(trial, prediction).reshape(residual.size, -1)])
        scattered = [names.index(n) for n in SCATTER_SD]
        now = point.scatter.get(trial.name, np.zeros(len(SCATTER_SD)))
        gram = trial_gram(residual.ravel(), slopes, self.sd_m, scattered, self.scatter_sd, now)
        return replace(gram, serial=serial_correlation(residual / self.sd_m), stale=stale)

    def grams(
        self,
        point: Point,
        coordinates: Sequence[Coordinate],
        trials: Sequence[Trial] | None = None,
        extra: Extra | None = None,
        *,
        stale: bool = False,
        rough: bool = False,
    ) -> dict[str, TrialGram]:
        """Return the Gram matrices of several trials.

        With `stale` the slopes may be those of the last request for the same coordinates, which costs a
        fifth; the residuals are always those at `point`. With `rough` motions are good enough for a model
        that leaves a plain misfit.
        """
        chosen = self.trials if trials is None else trials
        stale = stale and self.keeps and extra is None
        request = Request(point, tuple(coordinates), extra, stale, rough)
        found = self.own_grams(chosen, request) if self.crew is None else self.crew.grams(chosen, request)
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

"""Trials that are simulated again and again: each goes on from its own last mesh, derivatives and motion.

What a trial answers depends on its own earlier requests only, not on those of others, nor on their failures:
so the answers are the same to the last bit whoever simulates which trials.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial

import numpy as np

from srs_opt.calibrate.alignment import FREE, align
from srs_opt.calibrate.coordinates import SCATTER_SD, Coordinate
from srs_opt.calibrate.fit_settings import FIT
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.noise import Noise, track_of
from srs_opt.calibrate.normal_equations import NormalEquations, trial_normal_equations
from srs_opt.calibrate.observe import Prediction, predict
from srs_opt.calibrate.smooth import smooth_terms
from srs_opt.calibrate.trial_simulation import TRIAL, Meshes, Nodes, TrialRun
from srs_opt.calibrate.whiten import Whitening
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Trial
from srs_opt.robot import Robot
from srs_opt.simulate.batched import run_batched

Extra = Callable[[Trial, Prediction], np.ndarray]
Place = tuple[bool, dict[str, float]]  # where a trial was simulated: roughly or not, the values
Answer = NormalEquations | np.ndarray | NoAnswerError


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
    coordinates : tuple of Coordinate, optional
        By which the motions are derived for normal equations; the scattering parameters are among them.
        Without, the residuals are asked for.
    extra : callable, optional
        Residual functions, as further columns.
    stale : bool
        Whether derivatives of the last request for the same coordinates serve, wherever that was. Those of
        the same place always do.
    rough : bool
        Whether the motions need be no more accurate than a model needs that leaves a large misfit.
    noise : Noise, optional
        Default: the trials' own.
    """

    point: Point
    coordinates: tuple[Coordinate, ...] | None = None
    extra: Extra | None = None
    stale: bool = False
    rough: bool = False
    noise: Noise | None = None


@dataclass(frozen=True)
class KeptJacobian:
    """A trial's derivatives where they were last taken.

    Attributes
    ----------
    place : tuple
    names : tuple of str
        Coordinates.
    values : array (n, K)
        In single precision.
    """

    place: Place
    names: tuple[str, ...]
    values: np.ndarray


Memory = tuple[Meshes, Place | None, dict[bool, KeptJacobian]]


class Trials:
    """Trials held against a model, with what they need to go on: a `parallel.Work`.

    Parameters
    ----------
    model : Model
    trials : sequence of Trial
    noise : Noise
    tolerance_m_s : float
        Of the simulation.
    keeps : bool
        Whether derivatives and motions are kept for the next request.
    """

    def __init__(
        self, model: Model, trials: Sequence[Trial], noise: Noise, tolerance_m_s: float, *, keeps: bool
    ) -> None:
        self.model, self.noise, self.tolerance_m_s, self.keeps = model, noise, tolerance_m_s, keeps
        self._trials = {t.name: t for t in trials}
        self.runs = {t.name: TrialRun(model, t) for t in trials}
        self._tracks = {t.name: track_of(t) for t in trials}
        self._whitenings: dict[str, tuple[Noise, Whitening]] = {}
        # trial -> the last derivatives of requests without residual functions, and with them
        self._jacobian: dict[str, dict[bool, KeptJacobian]] = {t.name: {} for t in trials}
        self._new_jacobians: set[tuple[str, bool]] = set()
        self._motions: dict[str, tuple[Place, Nodes]] = {}
        self._last: dict[str, Place] = {}
        self._scatter_sd = np.array(list(SCATTER_SD.values()))

    def __reduce__(self) -> tuple[object, ...]:
        """Travel without the compiled model and without what was found."""
        model = self.model.robot, self.model.name, self.model.generic
        trials = tuple(self._trials.values())
        return _restored, (*model, trials, self.noise, self.tolerance_m_s, self.keeps)

    def part(self, names: Sequence[str]) -> Trials:
        """Return these trials alone, as if nothing had been asked."""
        trials = [self._trials[n] for n in names]
        return Trials(self.model, trials, self.noise, self.tolerance_m_s, keeps=self.keeps)

    def memory(self, names: Sequence[str], request: Request | None) -> dict[str, Memory]:
        """Return what the trials go on from: with a Jacobian if `request` uses it, or one that is new."""

        def wanted(name: str, wide: bool, kept: KeptJacobian) -> bool:
            if request is None:
                return (name, wide) in self._new_jacobians
            return _serve(kept, request, wide) or kept.place == self._place(name, request)

        return {
            n: (
                self.runs[n].meshes,
                self._last.get(n),
                {wide: kept for wide, kept in self._jacobian[n].items() if wanted(n, wide, kept)},
            )
            for n in names
        }

    def remember(self, memory: Mapping[str, Memory]) -> None:
        """Go on from there."""
        for name, (meshes, last, jacobian) in memory.items():
            self.runs[name].meshes = dict(meshes)
            self._motions.pop(name, None)
            if last is not None:
                self._last[name] = last
            self._jacobian[name] |= jacobian
        self._new_jacobians = set()

    def answer(self, names: Sequence[str], request: Request) -> dict[str, Answer]:
        """Return the trials' normal equations or residuals (T, 2 M), or why there are none; side by side."""
        found: dict[str, Answer] = {}
        for first in range(0, len(names), TRIAL.trials_at_once):
            some = names[first : first + TRIAL.trials_at_once]
            for name, nodes in self._simulated(some, request).items():
                found[name] = nodes if isinstance(nodes, NoAnswerError) else self._seen(name, nodes, request)
        return found

    def predict(
        self,
        name: str,
        point: Point,
        coordinates: Sequence[Coordinate] = (),
        tolerance_m_s: float | None = None,
    ) -> Prediction:
        """Return the prediction of one trial at `point`."""
        nodes = self.runs[name](point.of_trial(name), tolerance_m_s or self.tolerance_m_s)
        return self._predicted(name, nodes, point, coordinates)

    def _predicted(
        self, name: str, nodes: Nodes, point: Point, coordinates: Sequence[Coordinate]
    ) -> Prediction:
        trial, values = self._trials[name], point.of_trial(name)
        seen_of = partial(predict, self.model, centre_only=trial.markers_m is None)
        track = self._tracks[name]
        if not trial.moving or track is None:
            return seen_of(trial, nodes, values, coordinates)

        def later(shift_s: float) -> Trial:
            return replace(trial, time_s=trial.time_s + shift_s)

        # beyond half a cycle it would be another cycle; never before the valves' start
        most = min(0.5 * trial.period_s, float(trial.time_s[0]))
        found, free = align(track, lambda shift: seen_of(later(shift), nodes, values).points, most)
        raw = seen_of(later(found.later_s), nodes, values, coordinates)
        return Prediction(
            found.points(raw.points), found.jacobian(raw.jacobian), found.pose(raw.pose), raw.kappa, free
        )

    def _place(self, name: str, request: Request) -> Place:
        default = self.model.default
        # a value at its default is the same place whether a point names it or not
        values = {k: v for k, v in request.point.of_trial(name).items() if v != default(k)}
        return request.rough, values

    def _simulated(self, names: Sequence[str], request: Request) -> dict[str, Nodes | NoAnswerError]:
        """Return the trials' motions where they are asked for.

        One that was simulated there last is not simulated anew; where its motion was not kept, its last
        meshes serve as they are, which gives the same bits.
        """
        wanted = {n: self._place(n, request) for n in names}
        known: dict[str, Nodes | NoAnswerError] = {}
        for n in names:
            if n in self._motions and self._motions[n][0] == wanted[n]:
                known[n] = self._motions[n][1]
        tolerance = self.tolerance_m_s * (FIT.rough_tolerance if request.rough else 1.0)
        rest = [n for n in names if n not in known]
        attempts = [1 if self._last.get(n) == wanted[n] else None for n in rest]
        point = request.point
        searches = [self.runs[n].search(point.of_trial(n), tolerance, a) for n, a in zip(rest, attempts)]
        for name, nodes in zip(rest, run_batched(searches)):
            known[name] = nodes
            self._motions.pop(name, None)
            self._last.pop(name, None)
            if not isinstance(nodes, NoAnswerError):
                self._last[name] = wanted[name]
                if self.keeps:
                    self._motions[name] = wanted[name], nodes
        return {n: known[n] for n in names}

    def _seen(
        self, name: str, nodes: Nodes, request: Request
    ) -> NormalEquations | np.ndarray | NoAnswerError:
        track = self._tracks[name]
        assert track is not None
        if request.coordinates is None:
            return np.asarray(track - self._predicted(name, nodes, request.point, ()).points)
        point, extra = request.point, request.extra
        names = tuple(c.name for c in request.coordinates)
        wide, here = extra is not None, self._place(name, request)
        kept = self._jacobian[name].get(wide)
        # derivatives of this very place are not stale
        served = kept is not None and kept.place != here and _serve(kept, request, wide)
        # what was taken here already, whatever it was asked together with
        known = {k: v for s in self._jacobian[name].values() if s.place == here for k, v in _columns(s)}
        if served:
            assert kept is not None
            known = dict(_columns(kept))
        missing = [c for c in request.coordinates if c.name not in known]
        prediction = self._predicted(name, nodes, point, missing)
        residual = np.asarray(track - prediction.points)
        new = prediction.jacobian.reshape(residual.size, -1)
        known |= {c.name: new[:, k] for k, c in enumerate(missing)}
        jacobian = np.stack([known[n] for n in names], axis=1)
        if not (np.isfinite(prediction.points).all() and np.isfinite(jacobian).all()):
            # an integration on the edge of breaking down ends, and has no derivatives: no place for a fit
            return NoAnswerError(f"trial {name}: the motion has no finite derivatives there")
        if self.keeps and not served:
            # single precision: half the memory, and a derivative's eighth digit decides nothing
            self._jacobian[name][wide] = KeptJacobian(here, names, jacobian.astype(np.float32))
            self._new_jacobians.add((name, wide))
        if extra is not None:
            further = extra(self._trials[name], prediction).reshape(residual.size, -1)
            jacobian = np.column_stack([jacobian, further])
        noise = request.noise or self.noise
        own, own_sd = self._own(name, prediction, noise)
        scattered = [names.index(n) for n in SCATTER_SD]
        now = point.scatter.get(name, np.zeros(len(SCATTER_SD)))
        whiten = self._whitening(name, noise)
        normal = trial_normal_equations(
            residual.ravel(), jacobian, whiten, scattered, self._scatter_sd, now, own, own_sd
        )
        return replace(normal, stale=served)

    def _own(
        self, name: str, prediction: Prediction, noise: Noise
    ) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Return the columns of what is a trial's alone, and their priors: its alignment, smooth errors."""
        parts = []
        if prediction.free is not None:
            parts.append((prediction.free.reshape(-1, FREE), np.full(FREE, np.inf)))
        if noise.smooth:
            frames, coordinates = prediction.points.shape
            heading = prediction.pose[:, 2]
            parts.append(smooth_terms(self._trials[name], frames, coordinates, heading, noise))
        if not parts:
            return None, None
        return np.concatenate([p[0] for p in parts], axis=1), np.concatenate([p[1] for p in parts])

    def _whitening(self, name: str, noise: Noise) -> Whitening:
        known = self._whitenings.get(name)
        if known is None or known[0] != noise:
            track = self._tracks[name]
            assert track is not None
            known = noise, Whitening(noise, self._trials[name].time_s, np.isfinite(track))
            self._whitenings[name] = known
        return known[1]


def _serve(kept: KeptJacobian, request: Request, wide: bool) -> bool:
    """Whether kept derivatives serve although they are those of another place."""
    asked = None if request.coordinates is None else tuple(c.name for c in request.coordinates)
    return request.stale and wide == (request.extra is not None) and kept.names == asked


def _columns(kept: KeptJacobian) -> Iterator[tuple[str, np.ndarray]]:
    return zip(kept.names, kept.values.T)


@lru_cache(maxsize=4)
def _model(robot: Robot, model: str, generic: bool) -> Model:
    return Model(robot, model, generic=generic)


def _restored(
    robot: Robot,
    model: str,
    generic: bool,
    trials: Sequence[Trial],
    noise: Noise,
    tolerance_m_s: float,
    keeps: bool,
) -> Trials:
    return Trials(_model(robot, model, generic), trials, noise, tolerance_m_s, keeps=keeps)

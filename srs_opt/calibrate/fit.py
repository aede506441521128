"""Fit the model's coordinates to all trials at once: Gauss-Newton with priors and trial-to-trial scatter."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from srs_opt.calibrate.coordinates import SCATTER_SD, Coordinate
from srs_opt.calibrate.experiment import Point
from srs_opt.calibrate.fit_settings import FIT, OBJECTIVE
from srs_opt.calibrate.normal_equations import NormalEquations
from srs_opt.calibrate.objective import (
    Move,
    best_move,
    excess_of,
    geodesic_move,
    misfit_ratio,
    newton_step,
    objective,
    variance_inflation_of,
    within_reach,
)
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Trial

Report = Callable[[str], None]


class Measured(Protocol):
    """What a fit is held against."""

    @property
    def trials(self) -> Sequence[Trial]:
        """Return all that there are."""

    def normal_equations(
        self,
        point: Point,
        coordinates: Sequence[Coordinate],
        trials: Sequence[Trial] | None = None,
        *,
        stale: bool = False,
        rough: bool = False,
    ) -> dict[str, NormalEquations]:
        """Return the normal equations at `point`, by trial.

        `stale` allows derivatives of an earlier point, `rough` motions good enough for a large misfit.
        """


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
    variance_inflation : float
        By how much the noise variance was raised in the fit because the model does not explain the data.
    equations : dict
        Trial name -> NormalEquations at the point.
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
    variance_inflation: float
    equations: dict[str, NormalEquations]
    iterations: int
    converged: bool
    start_misfit_ratio: float = math.nan

    @property
    def off_bench(self) -> dict[str, float]:
        """By how many of its deviations each of the robot's values lies from its bench value."""
        robot = (c for c in self.coordinates if not c.effect and c.reported and math.isfinite(c.prior_sd))
        return {c.name: (self.point.values[c.name] - c.start) / c.prior_sd for c in robot}

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviations by coordinate."""
        return {c.name: float(s) for c, s in zip(self.coordinates, np.sqrt(np.diag(self.covariance)))}


def start_point(coordinates: Sequence[Coordinate]) -> Point:
    """Return the coordinates' starting values, no scatter."""
    return Point({c.name: c.start for c in coordinates})


def fit(
    experiment: Measured,
    coordinates: Sequence[Coordinate],
    start: Point | None = None,
    trials: Sequence[Trial] | None = None,
    iterations: int | None = None,
    report: Report | None = None,
    beat: float = math.inf,
    correlated: float | None = None,
    near: float = 0.0,
    *,
    rough: bool = False,
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
        Values that a misfit makes count as one: see `variance_inflation_of`.
    near : float
        Share of the misfit beyond the noise that a fit which does not explain the data may leave to be gained
        and still count as converged: its values need not be known well.
    rough : bool
        Whether the fit may end with derivatives of an earlier point, its covariance with them.

    Raises
    ------
    NoAnswerError
        If not even the starting point can be simulated.
    """
    coordinates = tuple(coordinates)
    iterations = FIT.iterations if iterations is None else iterations
    correlated = OBJECTIVE.correlated_values if correlated is None else correlated
    point = start_point(coordinates)
    if start is not None:
        names = {c.name for c in coordinates}
        kept = {n: v for n, v in start.values.items() if n in names}
        point = Point({**point.values, **kept}, dict(start.scatter))
    descent = _Descent(
        experiment, coordinates, experiment.trials if trials is None else trials, correlated, near
    )
    descent.begin(point)
    while not (descent.arrived() or descent.spent(iterations)):
        descent.step()
        if descent.hopeless(beat):
            break
        if report is not None:
            report(f"misfit {sum(g.misfit for g in descent.equations.values()):.0f}")
    return descent.end(rough=rough)


class _Descent:
    """Steps towards the most probable point; derivatives are kept while they predict what a step gains."""

    def __init__(
        self,
        experiment: Measured,
        coordinates: tuple[Coordinate, ...],
        trials: Sequence[Trial],
        correlated: float,
        near: float,
    ) -> None:
        self.experiment, self.coordinates, self.trials = experiment, coordinates, trials
        self.correlated, self.near = correlated, near
        self.done, self.idle, self.damping = 0, 0, 0.0
        self.converged, self.behind, self.rough = False, math.inf, True
        self.reached = math.nan  # deviance after the last step
        self.keeps = True  # until derivatives turn out not to be kept
        self.nonlinear = False  # whether the last step gained something else than the derivatives promised

    def begin(self, point: Point) -> None:
        """Linearise where the fit starts, roughly where the misfit is large."""
        self.point = point
        # the scatter's derivatives alone tell, for a third of the time
        few = [c for c in self.coordinates if c.name in SCATTER_SD] or self.coordinates
        first = self.experiment.normal_equations(point, few, self.trials, rough=True)
        self.rough = variance_inflation_of(first, self.correlated) > FIT.rough_inflation
        self.refresh()
        self.at_start = misfit_ratio(self.equations)

    def refresh(self) -> None:
        """Take the derivatives anew, from a fine simulation once the misfit does not hide a rough one."""
        self.equations = self._measured(self.point)
        if self.rough and self.variance_inflation <= FIT.rough_inflation:
            self.rough = False
            self.equations = self._measured(self.point)

    def _measured(
        self, point: Point, trials: Sequence[Trial] | None = None, *, stale: bool = False
    ) -> dict[str, NormalEquations]:
        some = self.trials if trials is None else trials
        return self.experiment.normal_equations(point, self.coordinates, some, stale=stale, rough=self.rough)

    @property
    def stale(self) -> bool:
        """Whether derivatives are those of an earlier point."""
        return any(g.stale for g in self.equations.values())

    @property
    def variance_inflation(self) -> float:
        """Factor on the noise variance."""
        return variance_inflation_of(self.equations, self.correlated)

    @property
    def jitter(self) -> float:
        """Deviance below which a loss is the integration's."""
        return max(
            FIT.converged_deviance,
            FIT.jitter_per_value * sum(g.count for g in self.equations.values()) / self.variance_inflation,
        )

    def now(self) -> float:
        """Return the objective at the point."""
        return objective(self.coordinates, self.equations, self.point, self.variance_inflation)

    def missing(self) -> float:
        """Return what the linearisation promises to gain."""
        return self.now() - within_reach(
            self.coordinates, self.equations, self.point, self.variance_inflation
        )

    def arrived(self) -> bool:
        """Whether fresh derivatives promise to gain next to nothing."""
        while True:
            enough, inflation = FIT.converged_deviance, self.variance_inflation
            if inflation > FIT.unexplained_inflation:
                near = max(self.near, FIT.rough_gain_share) if inflation > FIT.rough_inflation else self.near
                enough = max(FIT.converged_deviance, near * excess_of(self.equations) / inflation)
            if self.stale:
                enough = max(enough, FIT.stale_gain_share * excess_of(self.equations) / inflation)
            if self.missing() >= enough:
                return False
            if not self.stale:
                self.converged = True
                return True
            self.refresh()

    def spent(self, iterations: int) -> bool:
        """Whether to give up; what the integration's jitter hides then still counts as converged."""
        if self.done < iterations and self.idle < FIT.most_idle and self.damping <= FIT.most_damping:
            return False
        self.converged = not self.stale and self.missing() < self.jitter
        return True

    def step(self) -> None:
        """Go on where that gains, else take fresh derivatives or damp the next step."""
        self.done += 1
        stale, inflation, now, jitter = self.stale, self.variance_inflation, self.now(), self.jitter
        move = best_move(self.coordinates, self.equations, self.point, inflation, self.damping)
        try:
            if self.nonlinear and self.keeps and not stale:
                move = self._accelerated(move)
            moved = _moved(self.point, self.coordinates, move)
            equations = self._measured(moved, stale=True)
            before, after = (self.point, self.equations), (moved, equations)
            # before the gain is taken: it may exchange the equations of diverging trials
            moved = self._scatter_limited(before, after, inflation)
            # under the inflation before the step: with its own a worse misfit could look like a gain
            gain = now - objective(self.coordinates, equations, moved, inflation)
        except NoAnswerError:
            gain = -math.inf
        if gain > -jitter:
            self.idle = (
                self.idle + 1 if gain < FIT.converged_deviance and self.damping < 1 and not stale else 0
            )
            self.point, self.equations = moved, equations
            self._adapt_damping(gain, move.promised)
            off = abs(gain - move.promised) > FIT.trusted_share * move.promised
            self.nonlinear = off
            if off or (self.rough and self.variance_inflation <= FIT.rough_inflation):
                self.refresh()
        elif stale:
            self.nonlinear = True
            self.refresh()
        else:
            self.nonlinear = True
            self.damping = max(self.damping * FIT.damping_up, FIT.first_damping)

    def _adapt_damping(self, gain: float, promised: float) -> None:
        """Damp less where the derivatives were right, more where they were not."""
        if gain < FIT.trusted_share * promised:
            self.damping *= 2
        elif gain > (1 - FIT.trusted_share) * promised:
            self.damping = 0.0 if self.damping < FIT.least_damping else self.damping * FIT.damping_down

    def _accelerated(self, move: Move) -> Move:
        """Return the step with the second derivative along it taken into account."""
        short = replace(
            move,
            step=OBJECTIVE.probe_share * move.step,
            scatter={n: OBJECTIVE.probe_share * b for n, b in move.scatter.items()},
        )
        there = _moved(self.point, self.coordinates, short)
        ahead = self._measured(there, stale=True)
        self.keeps = any(g.stale for g in ahead.values())
        own = self.coordinates, self.equations, ahead, self.point, self.variance_inflation, self.damping
        return geodesic_move(*own, move) if self.keeps else move

    def _scatter_limited(
        self,
        before: tuple[Point, Mapping[str, NormalEquations]],
        after: tuple[Point, dict[str, NormalEquations]],
        inflation: float,
    ) -> Point:
        """Return the new point with the scatter of diverging trials taken back; their matrices follow.

        A trial near a change of its gait follows far less linearly than the others; its own scatter, which no
        other trial depends on, must not make the fit to all reject the step.
        """
        (point, equations), (moved, new_equations) = before, after
        step = np.array([moved.values[c.name] - point.values[c.name] for c in self.coordinates])

        # a trial's own part of the objective: its misfit and the prior of its scatter
        def own(normal: NormalEquations) -> float:
            return normal.misfit / inflation + float(np.sum((normal.scatter_now / normal.scatter_sd) ** 2))

        allowed = {}
        for name in {t.name for t in self.trials} & equations.keys():
            normal = equations[name]
            now = point.scatter.get(name, np.zeros_like(normal.scatter_sd))
            expected = normal.after(step, moved.scatter[name] - now, inflation)
            margin = (
                1
                + FIT.jitter_per_value * normal.count / inflation
                + FIT.trusted_share * abs(own(normal) - expected)
            )
            allowed[name] = expected + margin
        scatter = dict(moved.scatter)
        for part in FIT.scatter_parts:
            known = [t for t in self.trials if t.name in allowed]
            diverging = [t for t in known if own(new_equations[t.name]) > allowed[t.name]]
            if not 0 < len(diverging) <= len(allowed) // FIT.trials_per_diverging:
                break
            tried = dict(scatter)
            for t in diverging:
                now = point.scatter.get(t.name, np.zeros_like(equations[t.name].scatter_sd))
                tried[t.name] = now + part * (moved.scatter[t.name] - now)
            found = self._measured(Point(moved.values, tried), diverging, stale=True)
            for t in diverging:
                if own(found[t.name]) < own(new_equations[t.name]):
                    new_equations[t.name], scatter[t.name] = found[t.name], tried[t.name]
        return Point(moved.values, scatter)

    def hopeless(self, beat: float) -> bool:
        """Whether the fit stays far behind the one to beat, and does not catch up.

        What the derivatives promise to reach must come nearer by half with every step. A step that gained
        more than is still missing is reason enough to go on, whatever they promise: a body that begins to
        bend starts far off and comes near in a few large steps.
        """
        now = objective(self.coordinates, self.equations, self.point, 1.0)
        excess = within_reach(self.coordinates, self.equations, self.point) - beat
        far = max(FIT.hopeless_deviance, FIT.hopeless_share * abs(beat)) if math.isfinite(beat) else math.inf
        late = (
            self.done >= FIT.least_iterations and excess > far and excess > FIT.catch_up_share * self.behind
        )
        gained, self.reached = self.reached - now, now
        self.behind = excess
        return late and not gained > now - beat

    def end(self, *, rough: bool) -> Fit:
        """Return the fit at the point, its derivatives fresh unless they need not be."""
        if self.stale and not rough:
            self.refresh()
        return Fit(
            self.coordinates,
            self.point,
            newton_step(self.coordinates, self.equations, self.point, self.variance_inflation).covariance,
            objective(self.coordinates, self.equations, self.point, 1.0),
            misfit_ratio(self.equations),
            self.variance_inflation,
            self.equations,
            self.done,
            self.converged,
            self.at_start,
        )


def _moved(point: Point, coordinates: tuple[Coordinate, ...], move: Move) -> Point:
    """Return the point after a step."""
    values = dict(point.values)
    for coordinate, s in zip(coordinates, move.step):
        values[coordinate.name] += float(s)
    at = {n: point.scatter.get(n, np.zeros_like(b)) + b for n, b in move.scatter.items()}
    return Point(values, {**point.scatter, **at})

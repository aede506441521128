"""Fit the model's coordinates to all trials at once: Gauss-Newton with priors and trial-to-trial scatter."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from srs_opt.calibrate.coordinates import SCATTER_SD, Coordinate
from srs_opt.calibrate.experiment import Point
from srs_opt.calibrate.normal_equations import NormalEquations
from srs_opt.calibrate.objective import (
    AHEAD,
    CORRELATED,
    Move,
    bent_move,
    best_move,
    excess_of,
    misfit_ratio,
    newton_step,
    objective,
    variance_inflation_of,
    within_reach,
)
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Trial

ITERATIONS = 12
CONVERGED = 0.05  # of the deviance: a fifth of a standard deviation
# deviance, and share of it, that even the linearisation promises to stay behind the one to beat
HOPELESS, HOPELESS_SHARE = 300.0, 0.1
TRIED = 2  # iterations before that is believed
TRUSTED = 0.25  # of the gain that derivatives promise: with no larger error they serve for the next step too
PLAIN = 25.0  # variance inflation above which a misfit hides the errors of a simulation five times as rough
PLAINLY = 0.01  # share of such a misfit that need not be gained
CRAWL = 0.03  # share of the misfit; derivatives of an earlier point that promise less are not worth a step
FAR_OFF = 3.0  # variance inflation from which on a fit does not explain the data
LEAST_DAMPING = 0.001  # below: none
FIRST_DAMPING = 0.02
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

        `stale` allows derivatives of an earlier point, `rough` motions good enough for a plain misfit.
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
    iterations: int = ITERATIONS,
    report: Report | None = None,
    beat: float = math.inf,
    correlated: float = CORRELATED,
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
        Share of the misfit beyond the noise that a fit far off may leave to be gained and still count as
        converged: what does not explain the data need not be known well.
    rough : bool
        Whether the fit may end with derivatives of an earlier point, its covariance with them.

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
        self.bends = True  # until derivatives turn out not to be kept
        self.winding = False  # whether the last step found the valley bent

    def begin(self, point: Point) -> None:
        """Linearise where the fit starts, roughly where the misfit is plain."""
        self.point = point
        # the scatter's derivatives alone tell, for a third of the time
        few = [c for c in self.coordinates if c.name in SCATTER_SD] or self.coordinates
        first = self.experiment.normal_equations(point, few, self.trials, rough=True)
        self.rough = variance_inflation_of(first, self.correlated) > PLAIN
        self.refresh()
        self.at_start = misfit_ratio(self.equations)

    def refresh(self) -> None:
        """Take the derivatives anew, from a fine simulation once the misfit does not hide a rough one."""
        self.equations = self._measured(self.point)
        if self.rough and self.variance_inflation <= PLAIN:
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
            CONVERGED, JITTER * sum(g.count for g in self.equations.values()) / self.variance_inflation
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
            enough, inflation = CONVERGED, self.variance_inflation
            if inflation > FAR_OFF:
                near = max(self.near, PLAINLY) if inflation > PLAIN else self.near
                enough = max(CONVERGED, near * excess_of(self.equations) / inflation)
            if self.stale:
                enough = max(enough, CRAWL * excess_of(self.equations) / inflation)
            if self.missing() >= enough:
                return False
            if not self.stale:
                self.converged = True
                return True
            self.refresh()

    def spent(self, iterations: int) -> bool:
        """Whether to give up; what the integration's jitter hides then still counts as converged."""
        if self.done < iterations and self.idle < IDLE and self.damping <= MOST_DAMPING:
            return False
        self.converged = not self.stale and self.missing() < self.jitter
        return True

    def step(self) -> None:
        """Go on where that gains, else take fresh derivatives or damp the next step."""
        self.done += 1
        stale, inflation, now, jitter = self.stale, self.variance_inflation, self.now(), self.jitter
        move = best_move(self.coordinates, self.equations, self.point, inflation, self.damping)
        try:
            if self.winding and self.bends and not stale:
                move = self._bent(move)
            moved = _moved(self.point, self.coordinates, move)
            equations = self._measured(moved, stale=True)
            before, after = (self.point, self.equations), (moved, equations)
            moved = self._tamed(before, after, inflation)
            gain = now - objective(self.coordinates, equations, moved, inflation)
        except NoAnswerError:
            gain = -math.inf
        if gain > -jitter:
            self.idle = self.idle + 1 if gain < CONVERGED and self.damping < 1 and not stale else 0
            self.point, self.equations = moved, equations
            self._ease(gain, move.promised)
            off = abs(gain - move.promised) > TRUSTED * move.promised
            self.winding = off
            if off or (self.rough and self.variance_inflation <= PLAIN):
                self.refresh()
        elif stale:
            self.winding = True
            self.refresh()
        else:
            self.winding = True
            self.damping = max(self.damping * 4, FIRST_DAMPING)

    def _ease(self, gain: float, promised: float) -> None:
        """Damp less where the derivatives were right, more where they were not."""
        if gain < TRUSTED * promised:
            self.damping *= 2
        elif gain > (1 - TRUSTED) * promised:
            self.damping = 0.0 if self.damping < LEAST_DAMPING else self.damping * 0.3

    def _bent(self, move: Move) -> Move:
        """Return the step with the valley's bend followed."""
        short = replace(move, step=AHEAD * move.step, scatter={n: AHEAD * b for n, b in move.scatter.items()})
        there = _moved(self.point, self.coordinates, short)
        ahead = self._measured(there, stale=True)
        self.bends = any(g.stale for g in ahead.values())
        own = self.coordinates, self.equations, ahead, self.point, self.variance_inflation, self.damping
        return bent_move(*own, move) if self.bends else move

    def _tamed(
        self,
        before: tuple[Point, Mapping[str, NormalEquations]],
        after: tuple[Point, dict[str, NormalEquations]],
        inflation: float,
    ) -> Point:
        """Return the new point with the scatter of trials that went astray taken back; their matrices follow.

        A trial's scatter is its own affair: one near a change of its gait, which follows far less linearly
        than the others, must not hold up the fit to all.
        """
        (point, equations), (moved, new_equations) = before, after
        step = np.array([moved.values[c.name] - point.values[c.name] for c in self.coordinates])

        def own(normal: NormalEquations) -> float:
            return normal.misfit / inflation + float(np.sum((normal.scatter_now / normal.scatter_sd) ** 2))

        allowed = {}
        for name in {t.name for t in self.trials} & equations.keys():
            normal = equations[name]
            now = point.scatter.get(name, np.zeros_like(normal.scatter_sd))
            expected = normal.after(step, moved.scatter[name] - now, inflation)
            margin = 1 + JITTER * normal.count / inflation + TRUSTED * abs(own(normal) - expected)
            allowed[name] = expected + margin
        scatter = dict(moved.scatter)
        for part in TAKEN_BACK:
            known = [t for t in self.trials if t.name in allowed]
            astray = [t for t in known if own(new_equations[t.name]) > allowed[t.name]]
            if not 0 < len(astray) <= len(allowed) // FEW_ASTRAY:
                break
            tried = dict(scatter)
            for t in astray:
                now = point.scatter.get(t.name, np.zeros_like(equations[t.name].scatter_sd))
                tried[t.name] = now + part * (moved.scatter[t.name] - now)
            found = self._measured(Point(moved.values, tried), astray, stale=True)
            for t in astray:
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
        far = max(HOPELESS, HOPELESS_SHARE * abs(beat)) if math.isfinite(beat) else math.inf
        late = self.done >= TRIED and excess > far and excess > 0.5 * self.behind
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

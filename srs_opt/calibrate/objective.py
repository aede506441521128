"""What a fit minimises: misfit, priors, trial-to-trial scatter; and the step that the derivatives ask for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.experiment import Point
from srs_opt.calibrate.fit_settings import OBJECTIVE
from srs_opt.calibrate.normal_equations import NormalEquations, Solution, bounded_solve, scaled_inverse


def priors(coordinates: Sequence[Coordinate], point: Point) -> tuple[np.ndarray, np.ndarray]:
    """Return precision and offset of the priors at `point`."""
    # a free coordinate has no prior: precision 0
    precision = np.array([0.0 if np.isinf(c.prior_sd) else c.prior_sd**-2 for c in coordinates])
    offset = np.array([point.values.get(c.name, c.start) - c.start for c in coordinates])
    return precision, offset


def misfit_ratio(equations: Mapping[str, NormalEquations]) -> float:
    """Return the sum of squared residuals over its expectation under noise alone."""
    return sum(g.misfit for g in equations.values()) / sum(g.count for g in equations.values())


def variance_inflation_of(equations: Mapping[str, NormalEquations], correlated: float | None = None) -> float:
    """Return the factor on the noise variance that a misfit calls for.

    What a wrong model leaves behind is smooth in time and alike over the markers, so that `correlated` values
    count as one; without this, thousands of frames would pull the parameters far from their bench values.
    """
    correlated = OBJECTIVE.correlated_values if correlated is None else correlated
    # the misfit of pure noise has mean count and variance 2 count: no inflation below inflation_sd deviations
    count, ratio = sum(g.count for g in equations.values()), misfit_ratio(equations)
    return 1 + correlated * max(0.0, ratio - 1 - OBJECTIVE.inflation_sd * math.sqrt(2 / count))


def objective(
    coordinates: Sequence[Coordinate],
    equations: Mapping[str, NormalEquations],
    point: Point,
    inflation: float,
) -> float:
    """Return -2 log posterior at `point` with the trials' scatter integrated out."""
    precision, offset = priors(coordinates, point)
    parts = [g.eliminated(inflation) for g in equations.values()]
    return float(sum(e.at_point + e.log_det for e in parts) + precision @ offset**2)


def within_reach(
    coordinates: tuple[Coordinate, ...],
    equations: Mapping[str, NormalEquations],
    point: Point,
    inflation: float = 1.0,
) -> float:
    """Return the deviance at the minimum that the linearisation promises."""
    promised = best_move(coordinates, equations, point, inflation, longest=math.inf).promised
    return objective(coordinates, equations, point, inflation) - promised


def excess_of(equations: Mapping[str, NormalEquations]) -> float:
    """Return the misfit beyond what noise leaves."""
    return sum(max(g.misfit - g.count, 0.0) for g in equations.values())


@dataclass(frozen=True)
class Move:
    """A step of a fit.

    Attributes
    ----------
    step : array (K,)
    scatter : dict
        Trial name -> by how much its scatter moves.
    promised : float
        Deviance that the linearisation promises to gain.
    """

    step: np.ndarray
    scatter: dict[str, np.ndarray]
    promised: float


def best_move(
    coordinates: tuple[Coordinate, ...],
    equations: Mapping[str, NormalEquations],
    point: Point,
    inflation: float,
    damping: float = 0.0,
    longest: float | None = None,
) -> Move:
    """Return the step to the minimum that the derivatives promise, the scatter within its limits.

    A trial whose scatter would leave its limits has it held there, and the shared coordinates know: a model
    that lacks something drives scatter that far, and a step that counts on more of it would only lose.
    """
    longest = OBJECTIVE.longest_log_step if longest is None else longest
    held: dict[str, np.ndarray] = {}
    for _ in range(OBJECTIVE.held_rounds):
        parts = {n: g.eliminated(inflation, held.get(n), damping) for n, g in equations.items()}
        step = _solved(coordinates, [e.matrix for e in parts.values()], point, damping).step
        for k, c in enumerate(coordinates):
            # logarithms: a long step would change a value by orders of magnitude
            if not c.effect or c.log:
                step[k] = np.clip(step[k], -longest, longest)
        free = {n: e.back[:, -1] - e.back[:, :-1] @ step for n, e in parts.items()}
        scatter = {n: _within(equations[n], b) for n, b in free.items()}
        now = {n: _held(equations[n], b, free[n], step, inflation) for n, b in scatter.items()}
        # until the set of held scatters settles (an active-set iteration); NaN means free
        if all(np.array_equal(np.isnan(b), np.isnan(held.get(n, np.nan * b))) for n, b in now.items()):
            break
        held = now
    precision, offset = priors(coordinates, point)
    promised = sum(parts[n].at_point - g.after(step, scatter[n], inflation) for n, g in equations.items())
    # what the priors of the shared coordinates gain or lose
    promised += float(precision @ (offset**2 - (offset + step) ** 2))
    return Move(step, scatter, promised)


def geodesic_move(
    coordinates: tuple[Coordinate, ...],
    equations: Mapping[str, NormalEquations],
    ahead: Mapping[str, NormalEquations],
    point: Point,
    inflation: float,
    damping: float,
    move: Move,
) -> Move:
    """Return the step with half the geodesic acceleration added: it follows a curved valley.

    After Transtrum and Sethna (2012), doi 10.48550/arXiv.1201.5885. `ahead` are the normal equations where
    `probe_share` of the step leads, with the derivatives of the point.
    """
    bent = {
        n: g.acceleration(ahead[n], move.step, b, OBJECTIVE.probe_share)
        for n, (g, b) in _pairs(equations, move)
        if ahead[n].stale
    }
    parts = {n: g.eliminated(inflation, damping=damping) for n, g in bent.items()}
    rest = [g.eliminated(inflation).matrix.copy() for n, g in equations.items() if n not in bent]
    for matrix in rest:
        matrix[:-1, -1] = matrix[-1, :-1] = 0.0
    # a correction of second order knows neither bounds nor the priors' pull; the step after it does
    free = tuple(replace(c, lower=-math.inf, start=point.values[c.name]) for c in coordinates)
    turn = _solved(free, [*(e.matrix for e in parts.values()), *rest], point, damping).step
    turns = {n: e.back[:, -1] - e.back[:, :-1] @ turn for n, e in parts.items()}
    # their rule: the acceleration may not be longer than a share of the step, or the series is of no use
    length, size = (
        math.sqrt(sum(g.length2(s, b[n]) for n, g in equations.items() if n in bent))
        for s, b in ((move.step, move.scatter), (turn, turns))
    )
    share = 0.5 * min(1.0, OBJECTIVE.most_acceleration * length / max(size, 1e-300))
    lower = np.array([c.lower - point.values[c.name] for c in coordinates])
    # half the acceleration: the Taylor series' second term
    step = np.maximum(move.step + share * turn, lower)
    scatter = {n: _within(equations[n], b + share * turns.get(n, 0.0)) for n, b in move.scatter.items()}
    return Move(step, scatter, move.promised)


def _pairs(
    equations: Mapping[str, NormalEquations], move: Move
) -> Iterable[tuple[str, tuple[NormalEquations, np.ndarray]]]:
    return ((n, (g, move.scatter[n])) for n, g in equations.items())


def _within(normal: NormalEquations, moved: np.ndarray) -> np.ndarray:
    limit = OBJECTIVE.most_scatter_sd * normal.scatter_sd
    return np.asarray(np.clip(normal.scatter_now + moved, -limit, limit) - normal.scatter_now)


def _held(
    normal: NormalEquations, moved: np.ndarray, free: np.ndarray, step: np.ndarray, inflation: float
) -> np.ndarray:
    """Return the moves of what leaves its limits, or is held there and drawn further out; else NaN."""
    at = normal.scatter_now + moved
    # clipped to the limit, but for rounding
    at_limit = np.abs(at) >= OBJECTIVE.most_scatter_sd * normal.scatter_sd * (1 - 1e-9)
    outwards = (moved != free) | (normal.pull(step, moved, inflation) * at > 0)
    return np.where(at_limit & outwards, moved, np.nan)


def newton_step(
    coordinates: tuple[Coordinate, ...],
    equations: Mapping[str, NormalEquations],
    point: Point,
    inflation: float,
) -> Solution:
    """Solve for the step, holding coordinates that would leave their bounds at the bound."""
    return _solved(coordinates, [g.eliminated(inflation).matrix for g in equations.values()], point)


def _solved(
    coordinates: tuple[Coordinate, ...], matrices: Sequence[np.ndarray], point: Point, damping: float = 0.0
) -> Solution:
    precision, offset = priors(coordinates, point)
    now = np.array([point.values[c.name] for c in coordinates])
    lower = np.array([c.lower for c in coordinates])
    total = np.sum(matrices, axis=0)
    if damping:
        own = np.arange(len(coordinates))
        # Marquardt: relative to the diagonal, whatever the coordinates' units
        total[own, own] += damping * (total[own, own] + precision)
    return bounded_solve(total, range(len(coordinates)), precision, offset, lower - now)


def projected(total: np.ndarray, fitted: int, precision: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Project what is fitted out of what is not.

    Parameters
    ----------
    total : array (n, n)
        Normal equations, the fitted columns first.
    precision : array (fitted or more,)
        Of the priors.

    Returns
    -------
    inverse : array (fitted, fitted)
        Covariance of the fitted.
    left : array (n - fitted, n - fitted)
        Normal equations of the others after the fitted have followed them.
    """
    inverse = scaled_inverse(total[:fitted, :fitted] + np.diag(precision[:fitted]))
    # Schur complement: what the others tell that the fitted cannot imitate
    cross = total[:fitted, fitted:]
    return inverse, total[fitted:, fitted:] - cross.T @ inverse @ cross


def sum_eliminated(equations: Mapping[str, NormalEquations], inflation: float = 1.0) -> np.ndarray:
    """Return the sum of the trials' matrices, scatter integrated out."""
    total: np.ndarray = np.sum([g.eliminated(inflation).matrix for g in equations.values()], axis=0)
    return total

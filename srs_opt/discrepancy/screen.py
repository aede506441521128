"""Step 5: every candidate's score from one linearisation, without refitting any.

What a candidate would gain is computed with the calibrated parameters free to follow, so that the share
that calibration absorbs is taken off; bounds of physics hold; places are maximised over by being candidates
of their own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.calibrate.candidates import Candidate
from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.experiment import Point
from srs_opt.calibrate.normal_equations import NormalEquations, bounded_solve
from srs_opt.calibrate.objective import priors, sum_eliminated
from srs_opt.discrepancy.search_settings import SCREEN


@dataclass(frozen=True)
class Score:
    """One candidate's score.

    Attributes
    ----------
    candidate : Candidate
    improvement : float
        Drop of the deviance expected from adding it.
    absorbed : float
        Share of what the effect does that calibration could absorb, 0 to 1.
    step : array
        Expected sizes.
    """

    candidate: Candidate
    improvement: float
    absorbed: float
    step: np.ndarray

    @property
    def dof(self) -> int:
        """Number of sizes."""
        return len(self.candidate.sizes)

    @property
    def relative_size(self) -> float:
        """Expected size over the typical one."""
        return float(np.linalg.norm([s / c.typical for s, c in zip(self.step, self.candidate.sizes)]))


@dataclass(frozen=True)
class Linearisation:
    """Gram matrices over the fitted coordinates, all candidates' sizes, and residual functions.

    Attributes
    ----------
    coordinates : tuple of Coordinate
        Fitted ones first.
    fitted : int
        How many of them.
    point : Point
    equations : dict
    variance_inflation : float
    screened : frozenset of str, optional
        Keys of the equations that know what the candidates do; in the others they do nothing. Default: all.
    """

    coordinates: tuple[Coordinate, ...]
    fitted: int
    point: Point
    equations: Mapping[str, NormalEquations]
    variance_inflation: float
    screened: frozenset[str] | None = None

    @property
    def telling(self) -> Mapping[str, NormalEquations]:
        """The equations that know what the candidates do."""
        known = self.screened
        return {n: g for n, g in self.equations.items() if known is None or n in known}

    def column(self, name: str) -> int:
        """Return the column of a coordinate."""
        return [c.name for c in self.coordinates].index(name)


def screen(
    lin: Linearisation, candidates: Sequence[Candidate], dropped: Sequence[Candidate] = ()
) -> list[Score]:
    """Return the scores of `candidates`, best first.

    Parameters
    ----------
    dropped : sequence of Candidate
        Effects of the fitted model that are taken out first (their sizes go to zero): a swap.
    """
    size = len(lin.coordinates)
    index = [*range(size), next(iter(lin.equations.values())).raw.shape[0] - 1]
    total = sum_eliminated(lin.telling, lin.variance_inflation)[np.ix_(index, index)]
    precision, offset = priors(lin.coordinates, lin.point)
    now = np.array([lin.point.values.get(c.name, 0.0) for c in lin.coordinates])
    lower = np.array([c.lower for c in lin.coordinates]) - now
    base = list(range(lin.fitted))
    # before anything is dropped: a swap has to beat the model with the effect in it
    reference = bounded_solve(total, base, precision, offset, lower)
    gone = [lin.column(c.name) for k in dropped for c in k.coordinates]
    if gone:
        total, offset = _without(total, gone, now, offset)
        base = [k for k in base if k not in gone]
    scores = []
    for candidate in candidates:
        own = [lin.column(c.name) for c in candidate.sizes]
        if any(k < lin.fitted for k in own):
            continue
        solution = bounded_solve(total, [*base, *own], precision, offset, lower)
        free = np.diag(total)[own]
        # information on a size once the fitted have followed, against that with them held
        kept = 1 / np.maximum(np.diag(solution.covariance)[len(base) :], 1e-300)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 1 - np.where(free > 0, kept / free, 1.0)
        absorbed = float(np.clip(np.mean(share), 0.0, 1.0))
        gain = reference.deviance - solution.deviance
        scores.append(Score(candidate, float(gain), absorbed, solution.step[len(base) :]))
    return sorted(scores, key=lambda s: -s.improvement)


def _without(
    total: np.ndarray, gone: list[int], now: np.ndarray, offset: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Move the point of linearisation to where some coordinates are zero."""
    step = np.zeros(total.shape[0])
    step[gone] = -now[gone]
    moved = total.copy()
    # residual r - Y step: gradient and deviance of the quadratic, moved
    moved[:, -1] -= total @ step
    moved[-1, -1] = total[-1, -1] - 2 * total[-1] @ step + step @ total @ step
    moved[-1, :-1] = moved[:-1, -1]
    return moved, offset + step[:-1]


def expected_start(lin: Linearisation, score: Score, damped: float = 1.0) -> Point:
    """Return where to begin a refit with the candidate added: at its expected sizes, within reason."""
    values = dict(lin.point.values)
    for coordinate, step in zip(score.candidate.sizes, score.step):
        # about a fit that is far off linear sizes can be absurd
        reach = SCREEN.start_reach * coordinate.typical
        values[coordinate.name] = float(np.clip(damped * step, -reach, reach))
    for coordinate in score.candidate.scales:
        values[coordinate.name] = coordinate.start
    return Point(values, dict(lin.point.scatter))

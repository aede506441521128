"""Which effects act alike on the data at hand: angles between what they do, the fit's freedom removed."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.calibrate.candidates import Candidate
from srs_opt.calibrate.objective import priors, projected, sum_eliminated
from srs_opt.discrepancy.screen import Linearisation
from srs_opt.discrepancy.search_settings import SCREEN


@dataclass(frozen=True)
class Pair:
    """Two effects and the angle (rad) between their sensitivities, at the places that are most alike."""

    effects: tuple[str, str]
    angle_rad: float


class Angles:
    """Angles between candidates' sensitivities in noise units, after projection on all that is fitted.

    Parameters
    ----------
    lin : Linearisation
        With the candidates' sizes among its coordinates.
    apart : sequence of Candidate, optional
        Fitted ones that are held against the others too, instead of projecting what they do out.
    """

    def __init__(self, lin: Linearisation, apart: Sequence[Candidate] = ()) -> None:
        own = {c.name for k in apart for c in k.coordinates}
        sizes = {c.name for k in apart for c in k.sizes}
        fitted = [k for k, c in enumerate(lin.coordinates[: lin.fitted]) if c.name not in own]
        free = [k for k, c in enumerate(lin.coordinates) if k >= lin.fitted or c.name in sizes]
        self._names = {lin.coordinates[k].name: n for n, k in enumerate(free)}
        self._lower = [lin.coordinates[k].lower for k in free]
        # the fitted first, as `projected` takes them
        order = [*fitted, *free]
        total = sum_eliminated(lin.telling, lin.variance_inflation)[np.ix_(order, order)]
        precision, _ = priors([lin.coordinates[k] for k in order], lin.point)
        _, self._seen = projected(total, len(fitted), precision)
        self._whole = np.diag(total)[len(fitted) :]

    def columns(self, candidate: Candidate) -> list[int]:
        """Return where a candidate's sizes are; nothing for one that is fitted or not seen by the data."""
        own = [self._names.get(c.name, -1) for c in candidate.sizes]
        # what the projection leaves below 1e-9 of a column is rounding, and its direction means nothing
        if min(own) < 0 or any(self._seen[k, k] <= 1e-9 * self._whole[k] for k in own):
            return []
        return own

    def between(self, a: Candidate, b: Candidate) -> float | None:
        """Return the angle of two candidates, rad; of the nearest directions where they have several sizes.

        Effects that cannot change sign and do opposite things are not alike. None where the data do not see
        one of them.
        """
        first, second = self.columns(a), self.columns(b)
        if not first or not second:
            return None
        # principal angles between the subspaces that the candidates' columns span, orthonormalised
        cosines = _root(self._seen[np.ix_(first, first)]) @ self._seen[np.ix_(first, second)]
        cosines = cosines @ _root(self._seen[np.ix_(second, second)])
        if len(first) == len(second) == 1 and self._lower[first[0]] == self._lower[second[0]] == 0:
            largest = float(cosines[0, 0])
        else:
            largest = float(np.linalg.svd(cosines, compute_uv=False)[0])
        return float(np.arccos(np.clip(largest, -1.0, 1.0)))


def _root(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse square root of a small positive matrix."""
    values, vectors = np.linalg.eigh(matrix)
    # the floor keeps columns that are multiples of each other from dividing by zero
    return np.asarray(vectors / np.sqrt(np.maximum(values, 1e-300)) @ vectors.T)


def alike_pairs(
    lin: Linearisation, candidates: Sequence[Candidate], most_rad: float | None = None
) -> tuple[Pair, ...]:
    """Return the pairs of effects that the data can hardly tell apart, the nearest first.

    Angles are at most `most_rad`, by default `ScreenSettings.alike_rad`.
    """
    limit = SCREEN.alike_rad if most_rad is None else most_rad
    angles = Angles(lin)
    best: dict[tuple[str, str], float] = {}
    for a, b in itertools.combinations(candidates, 2):
        if a.effect != b.effect:
            angle = angles.between(a, b)
            pair = (a.effect, b.effect)
            if angle is not None and angle <= min(limit, best.get(pair, np.inf)):
                best[pair] = angle
    return tuple(Pair(pair, angle) for pair, angle in sorted(best.items(), key=lambda item: item[1]))

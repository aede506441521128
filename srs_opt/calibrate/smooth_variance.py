"""Size of the smooth errors that no effect explains: drift, and errors that repeat with the gait.

Their variances are estimated by restricted maximum likelihood from normal equations in which the amplitudes
of every trial are still columns, with everything that the model could lack free to follow: an effect is
never taken for noise. They are believed only where they are small and leave nothing unexplained.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.data_settings import SMOOTH_ERRORS
from srs_opt.calibrate.experiment import Point
from srs_opt.calibrate.noise import Noise
from srs_opt.calibrate.normal_equations import NormalEquations, solve
from srs_opt.calibrate.objective import priors


@dataclass(frozen=True)
class Amplitudes:
    """Columns of smooth errors in a trial's normal equations.

    Attributes
    ----------
    drift, systematic : dict
        Column -> the column's size when the drift, or the systematic error, is 1 m.
    """

    drift: Mapping[int, float]
    systematic: Mapping[int, float]

    def sizes(self, drift_m: float, systematic_m: float) -> dict[int, float]:
        """Return the deviation of every column's coefficient that is not zero."""
        both = ((self.drift, drift_m), (self.systematic, systematic_m))
        return {k: unit * size for units, size in both if size > 0 for k, unit in units.items()}


def smooth_part(
    noise: Noise,
    equations: Mapping[str, NormalEquations],
    amplitudes: Mapping[str, Amplitudes],
    coordinates: Sequence[Coordinate],
    point: Point,
) -> Noise:
    """Return the noise with the smooth errors that the normal equations show.

    Parameters
    ----------
    equations : dict
        Under `noise`, which is to have no smooth part, with columns for the amplitudes.
    amplitudes : dict
        By trial; those of trials that are not named have none.
    coordinates : sequence of Coordinate
        The first columns: parameters, and effects that the model may lack.
    point : Point
        Where they stand.
    """
    precision, offset = priors(coordinates, point)
    loose = np.array([SMOOTH_ERRORS.free_sizes * c.typical for c in coordinates])
    # a wide prior, so that the determinant exists where the data say nothing of an effect
    precision = np.where(precision > 0, precision, loose**-2.0)
    free = range(len(coordinates))
    count = sum(g.count for g in equations.values())
    tried = {
        (drift, systematic): _deviance(equations, amplitudes, (drift, systematic), free, precision, offset)
        for drift in SMOOTH_ERRORS.drifts_m
        for systematic in SMOOTH_ERRORS.systematic_m
    }
    plain = tried[0.0, 0.0]
    drift, systematic = min(tried, key=lambda key: sum(tried[key]))
    misfit, _ = tried[drift, systematic]
    # the misfit of noise alone has mean count and variance 2 count
    explained = misfit < count + SMOOTH_ERRORS.most_left_sd * math.sqrt(2 * count)
    if not explained or sum(plain) - sum(tried[drift, systematic]) < SMOOTH_ERRORS.detected_deviance:
        return noise
    return replace(noise, drift_m=drift, systematic_m=systematic)


def _deviance(
    equations: Mapping[str, NormalEquations],
    amplitudes: Mapping[str, Amplitudes],
    sizes_m: tuple[float, float],
    free: Sequence[int],
    precision: np.ndarray,
    offset: np.ndarray,
) -> tuple[float, float]:
    """Return the misfit and the log determinants of -2 log restricted likelihood."""
    total, log_det = np.zeros(()), 0.0
    for name, normal in equations.items():
        own = amplitudes[name].sizes(*sizes_m) if name in amplitudes else {}
        reduced, more = _integrated(normal, own, free)
        parts = reduced.eliminated()
        total = total + parts.matrix
        log_det += more + parts.log_det
    every = range(len(free))
    a = total[:-1, :-1] + np.diag(precision)
    # scaled to unit diagonal, so that the determinant does not overflow; the scale is taken off again
    scale = 1 / np.sqrt(np.maximum(np.diag(a), 1e-300))
    log_det += float(np.linalg.slogdet(a * scale[:, None] * scale)[1] - 2 * np.log(scale).sum())
    return solve(total, every, precision, offset).deviance, log_det


def _integrated(
    normal: NormalEquations, own: Mapping[int, float], free: Sequence[int]
) -> tuple[NormalEquations, float]:
    """Return the equations over `free` with the columns `own` integrated out, and their log determinant."""
    kept = [*free, normal.raw.shape[0] - 1]
    raw, log_det = normal.raw[np.ix_(kept, kept)], 0.0
    if own:
        index, size = list(own), np.array(list(own.values()))
        inner = normal.raw[np.ix_(index, index)] * size[:, None] * size + np.eye(len(index))
        cross = normal.raw[np.ix_(index, kept)] * size[:, None]
        raw = raw - cross.T @ np.linalg.solve(inner, cross)
        log_det = float(np.linalg.slogdet(inner)[1])
    scattered = tuple(kept.index(k) for k in normal.scattered)
    return NormalEquations(raw, normal.count, scattered, normal.scatter_sd, normal.scatter_now), log_det

"""How much of the camera's noise is correlated in time, from the distances between neighbouring markers.

A body cannot stretch: whatever the model has wrong about how it moves and bends, distances along it hardly
change, while noise of the markers' own does. The correlated part is estimated there, by restricted maximum
likelihood, with the gait's waves and slow trends free in every distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from srs_opt.calibrate.data_settings import COLOURED_NOISE
from srs_opt.calibrate.noise import Noise, track_of
from srs_opt.calibrate.smooth import gait_waves
from srs_opt.calibrate.whiten import Whitening
from srs_opt.measurement.records import Trial


def coloured(noise: Noise, trials: Sequence[Trial], residuals: Sequence[np.ndarray]) -> Noise:
    """Return the noise with its correlated part as the residuals (T, 2 M) of a fit show it.

    White where nothing is found, or where there are no two markers to compare; what the data set states
    about the correlated part stays as it is.
    """
    if noise.correlated_sd_m > 0:
        return noise
    data = [d for t, r in zip(trials, residuals) if (d := _distances(t, r)) is not None]
    if not data or noise.white_sd_m <= 0:
        return noise
    plain = _deviance(noise, data)
    found = min(
        (_deviance(_with(noise, share, time), data), share, time)
        for time in COLOURED_NOISE.times_s
        for share in COLOURED_NOISE.shares
    )
    if plain - found[0] < COLOURED_NOISE.detected_deviance:
        return noise
    from scipy.optimize import minimize

    start = np.log([noise.white_sd_m, noise.white_sd_m * np.sqrt(found[1]), found[2]])

    def of(log: np.ndarray) -> float:
        white, walk, time = np.exp(log)
        return _deviance(Noise(white, walk, time), data)

    # in logarithms, which keep all three positive
    simplex = start + np.vstack([np.zeros(3), np.diag(COLOURED_NOISE.first_steps)])
    options = {"xatol": 0.02, "fatol": 0.2, "maxfev": 120, "initial_simplex": simplex}
    best = minimize(of, start, method="Nelder-Mead", options=options)
    white, walk, time = np.exp(best.x)
    most_walk_m = max(COLOURED_NOISE.most_correlated * noise.white_sd_m, COLOURED_NOISE.most_correlated_m)
    # no camera errs that much: what shows is the model's misfit
    if white > COLOURED_NOISE.most_white_growth * noise.white_sd_m or walk > most_walk_m:
        return noise
    return replace(noise, white_sd_m=float(white), correlated_sd_m=float(walk), correlation_s=float(time))


def _with(noise: Noise, share: float, time: float) -> Noise:
    return replace(noise, correlated_sd_m=noise.white_sd_m * float(np.sqrt(share)), correlation_s=time)


@dataclass(frozen=True)
class _Distances:
    """Residual distances (T, M - 1) of a trial's neighbours, and what is free in each, (T, Q)."""

    time_s: np.ndarray
    values: np.ndarray
    free: np.ndarray


def _distances(trial: Trial, residual: np.ndarray) -> _Distances | None:
    """Return measured less predicted distances; None where there are no two markers."""
    track = track_of(trial)
    assert track is not None
    frames = len(trial.time_s)
    # the predicted places: directions between measured ones would carry the noise
    apart = np.diff((track - residual).reshape(frames, -1, 2), axis=1)
    if apart.shape[1] == 0:
        return None
    along = apart / np.linalg.norm(apart, axis=2, keepdims=True)
    values = (np.diff(residual.reshape(frames, -1, 2), axis=1) * along).sum(axis=2)
    part = np.linspace(-1, 1, frames)
    free = np.column_stack([np.ones(frames), part, part**2, *gait_waves(trial, COLOURED_NOISE.harmonics)])
    return _Distances(trial.time_s, values, free)


def _deviance(noise: Noise, data: Sequence[_Distances]) -> float:
    """Return -2 log restricted likelihood of the distances, each with twice a coordinate's variance."""
    # a distance has the noise of both its ends
    root = np.sqrt(2)
    doubled = replace(noise, white_sd_m=root * noise.white_sd_m, correlated_sd_m=root * noise.correlated_sd_m)
    total = 0.0
    for d in data:
        seen = np.isfinite(d.values)
        whiten = Whitening(doubled, d.time_s, seen)
        channels, size = d.values.shape[1], d.free.shape[1]
        columns = np.column_stack([np.nan_to_num(d.values).ravel(), np.repeat(d.free, channels, axis=0)])
        white = whiten(columns)
        total += whiten.log_det
        # whitened values stand coordinate by coordinate where correlated, else frame by frame
        owner = np.nonzero(seen.T)[0] if noise.correlated_sd_m > 0 else np.nonzero(seen)[1]
        for k in range(channels):
            own = white[owner == k]
            # too few values for all that is free in them
            if len(own) <= 2 * size:
                continue
            both = own.T @ own
            # restricted likelihood: what the free columns leave, and the log determinant of their information
            rest = both[0, 0] - both[0, 1:] @ np.linalg.solve(both[1:, 1:], both[1:, 0])
            total += float(rest + np.linalg.slogdet(both[1:, 1:])[1])
    return total

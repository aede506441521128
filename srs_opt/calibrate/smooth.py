"""Smooth errors of a trial that neither the model nor independent noise explains: drift, and a gait's own.

Their amplitudes are random, independent from trial to trial, and are integrated out of the normal equations.
"""

from __future__ import annotations

import math

import numpy as np

from srs_opt.calibrate.data_settings import SMOOTH_ERRORS
from srs_opt.calibrate.noise import Noise
from srs_opt.calibrate.observe import Prediction
from srs_opt.geometry import quarter_turn, unit_vectors
from srs_opt.measurement.records import Trial

UNIT = Noise(0.0, drift_m=1.0, systematic_m=1.0)
DRIFTS = 4  # columns of drift, which come first


def smooth_terms(
    trial: Trial, frames: int, coordinates: int, heading_rad: np.ndarray, noise: Noise
) -> tuple[np.ndarray, np.ndarray]:
    """Return columns (T C, Q) of unit amplitude, and the deviations of their amplitudes (Q,), m.

    Drift: shifts of the whole picture along x and y that grow with time, evenly or ever faster. Systematic
    errors: Legendre polynomials of the place along the body, forwards and across, times waves of the gait.
    """
    columns, sd = [], []
    markers = coordinates // 2
    if noise.drift_m > 0:
        part = np.linspace(0, 1, frames)
        # from 0 to 1, and a parabola of height 1 that leaves the ends where they are
        for way, share in ((part, 1.0), (4 * part * (1 - part), 0.25)):
            columns += [_shift(way, np.broadcast_to(np.eye(2)[k], (frames, 2)), markers) for k in range(2)]
            sd += [share * noise.drift_m] * 2
    if noise.systematic_m > 0:
        forwards = unit_vectors(heading_rad)
        across = quarter_turn(forwards)
        place = np.linspace(-1, 1, markers) if markers > 1 else np.zeros(1)
        for wave in gait_waves(trial):
            # no more shapes than the markers tell apart
            for order in range(min(SMOOTH_ERRORS.shapes, markers)):
                shape = np.polynomial.Legendre.basis(order)(place)
                columns += [_shift(wave, d, markers, shape) for d in (forwards, across)]
        sd += [noise.systematic_m] * (len(columns) - len(sd))
    return np.stack([c.ravel() for c in columns], axis=1), np.array(sd)


def unit_terms(trial: Trial, prediction: Prediction) -> np.ndarray:
    """Return the columns (T, 2 M, Q) of both kinds, for a drift and a systematic error of 1 m."""
    frames, coordinates = prediction.points.shape
    columns, sd = smooth_terms(trial, frames, coordinates, prediction.pose[:, 2], UNIT)
    return np.asarray((columns * sd).reshape(frames, coordinates, -1))


def gait_waves(trial: Trial, harmonics: int | None = None) -> list[np.ndarray]:
    """Return cosines and sines of the gait's phase and its multiples, (T,) each; none without a period."""
    if not math.isfinite(trial.period_s):
        return []
    harmonics = SMOOTH_ERRORS.harmonics if harmonics is None else harmonics
    phase = 2 * math.pi * trial.time_s / trial.period_s
    return [f(k * phase) for k in range(1, harmonics + 1) for f in (np.cos, np.sin)]


def _shift(
    wave: np.ndarray, direction: np.ndarray, markers: int, shape: np.ndarray | None = None
) -> np.ndarray:
    """Return displacements (T, 2 M): a function of time, a direction per frame, a shape along the body."""
    weight = np.ones(markers) if shape is None else shape
    return np.asarray(
        (wave[:, None, None] * direction[:, None, :] * weight[None, :, None]).reshape(-1, 2 * markers)
    )

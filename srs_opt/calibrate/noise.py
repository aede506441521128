"""The markers' noise from the tracks themselves: fourth differences leave noise and hardly any motion."""

from __future__ import annotations

from math import comb

import numpy as np

from srs_opt.measurement.records import DataSet, Trial

ORDER = 4
_LEAST = 50  # differences that an estimate needs
_MAD = 0.674489750196  # median |x| of a unit normal
_WILD = 5.0  # robust standard deviations beyond which a difference is a jump, not noise


def track_of(trial: Trial) -> np.ndarray | None:
    """Return the trial's measured coordinates, (T, 2 M), NaN where lost."""
    points = trial.markers_m if trial.markers_m is not None else trial.centre_m
    return None if points is None else points.reshape(len(trial.time_s), -1)


def noise_sd_m(dataset: DataSet) -> float:
    """Return the noise per coordinate that a fit of independent samples is to assume.

    The white part is estimated from the tracks; one that the data set states to be correlated in time adds
    the white noise with the same spectral density at frequencies below 1/correlation_s, where motion is:
    exponentially correlated noise has 2 sd^2 tau there, white noise of n samples a second sd^2/n.
    """
    correlated = 2 * dataset.correlated_sd_m**2 * dataset.correlation_s * dataset.rate_hz
    return float(np.hypot(_white_sd_m(dataset), np.sqrt(correlated)))


def _white_sd_m(dataset: DataSet) -> float:
    """Return the white part, robustly; what the data set states when there are too few frames."""
    found = []
    for trial in dataset.trials:
        track = track_of(trial)
        if track is not None and track.shape[0] > ORDER:
            differences = np.diff(track, ORDER, axis=0).ravel()
            found.append(differences[np.isfinite(differences)])
    pooled = np.concatenate(found) if found else np.zeros(0)
    if pooled.size < _LEAST:
        return dataset.marker_sd_m
    gain = np.sqrt(comb(2 * ORDER, ORDER))
    size = np.abs(pooled)
    usual = np.median(size) / _MAD
    sd = float(np.sqrt(np.mean(size[size <= _WILD * usual] ** 2)) / gain)
    return sd if sd > 0 else dataset.marker_sd_m

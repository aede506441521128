"""The camera's noise: what is known of it, and its white part from the tracks themselves.

Fourth differences of a track leave noise and hardly any motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

from srs_opt.calibrate.data_settings import WHITE_NOISE
from srs_opt.measurement.noise import MAD
from srs_opt.measurement.records import DataSet, Trial

ORDER = 4  # of the differences: of a cycle of 100 frames they leave 2e-5 of the amplitude


@dataclass(frozen=True)
class Noise:
    """Covariance of a trial's measured values: everything that is neither the model nor the trial's scatter.

    Attributes
    ----------
    white_sd_m : float
        Standard deviation per coordinate, independent from frame to frame.
    correlated_sd_m, correlation_s : float
        Further noise per coordinate, an Ornstein-Uhlenbeck process of its own: sd^2 exp(-|dt|/correlation_s).
    drift_m : float
        Standard deviation, per direction, of how far the whole picture drifts in a trial.
    systematic_m : float
        Standard deviation of the amplitudes of smooth errors that repeat with the gait (`smooth_terms`).
    """

    white_sd_m: float
    correlated_sd_m: float = 0.0
    correlation_s: float = 0.0
    drift_m: float = 0.0
    systematic_m: float = 0.0

    @property
    def in_words(self) -> str:
        """What it is made of."""
        parts = [f"{1e3 * self.white_sd_m:.2g} mm white"]
        if self.correlated_sd_m > 0:
            parts.append(f"{1e3 * self.correlated_sd_m:.2g} mm correlated over {self.correlation_s:.2g} s")
        if self.drift_m > 0:
            parts.append(f"{1e3 * self.drift_m:.2g} mm of drift in a trial")
        if self.systematic_m > 0:
            parts.append(f"{1e3 * self.systematic_m:.2g} mm that repeats with the gait")
        return ", ".join(parts)

    @property
    def smooth(self) -> bool:
        """Whether there are smooth terms."""
        return self.drift_m > 0 or self.systematic_m > 0


def track_of(trial: Trial) -> np.ndarray | None:
    """Return the trial's measured coordinates, (T, 2 M), NaN where lost."""
    points = trial.markers_m if trial.markers_m is not None else trial.centre_m
    return None if points is None else points.reshape(len(trial.time_s), -1)


def noise_of(dataset: DataSet) -> Noise:
    """Return the noise that is known before any fit: the white part as the tracks show it, else as stated."""
    if not dataset.correlated_sd_m:
        return Noise(_white_sd_m(dataset))
    return Noise(_white_sd_m(dataset), dataset.correlated_sd_m, dataset.correlation_s)


def _white_sd_m(dataset: DataSet) -> float:
    """Return the white part, robustly; what the data set states when there are too few frames."""
    found = []
    for trial in dataset.trials:
        track = track_of(trial)
        if track is not None and track.shape[0] > ORDER:
            differences = np.diff(track, ORDER, axis=0).ravel()
            found.append(differences[np.isfinite(differences)])
    pooled = np.concatenate(found) if found else np.zeros(0)
    if pooled.size < WHITE_NOISE.least_differences:
        return dataset.marker_sd_m
    # sum of squared binomial coefficients: the variance of fourth differences of white noise over its own, 70
    gain = np.sqrt(comb(2 * ORDER, ORDER))
    size = np.abs(pooled)
    # by the median first: jumps must not widen the window that leaves them out
    usual = np.median(size) / MAD
    sd = float(np.sqrt(np.mean(size[size <= WHITE_NOISE.jump_sd * usual] ** 2)) / gain)
    return sd if sd > 0 else dataset.marker_sd_m

"""What real cameras and notebooks add: correlated noise, drift, outliers, exchanged labels, wrong entries."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from virtual_lab.assemble import Factors
from virtual_lab.errors import LabError
from virtual_lab.trials import Trial

FARTHEST_OUTLIER_M = 0.03  # half a link: farther ones no tracker would take for the marker
LEAST_OUTLIER_SD = 5.0
SWAP_S = 0.15  # how long two labels stay exchanged
OTHER_ROBOT = Factors(friction_normal=0.6, curvature=0.8)
HARMONICS = 2  # of the gait, in the systematic error


@dataclass(frozen=True)
class Disturbances:
    """What the recording adds to white noise and lost markers; nothing by default.

    Attributes
    ----------
    correlated_sd_m, correlation_s : float
        Noise per coordinate that is correlated in time, exp(-|dt|/correlation_s), each marker's its own.
    drift_m : float
        How far the whole picture creeps during a trial, in a direction of its own.
    outlier_share : float
        Share of positions that are elsewhere, by five deviations of the noise to 3 cm.
    swap_share : float
        Share of frames in which the labels of two neighbours are exchanged, for 0.15 s at a time.
    systematic_sd_m : float
        Root mean square of a smooth error that repeats with the gait, the same in every trial of a gait.
    """

    correlated_sd_m: float = 0.0
    correlation_s: float = 0.2
    drift_m: float = 0.0
    outlier_share: float = 0.0
    swap_share: float = 0.0
    systematic_sd_m: float = 0.0

    def __post_init__(self) -> None:
        sizes = self.correlated_sd_m, self.drift_m, self.systematic_sd_m
        shares = self.outlier_share, self.swap_share
        if min(sizes) < 0 or not self.correlation_s > 0 or not all(0 <= p <= 0.5 for p in shares):
            raise LabError(
                "expected noise, drift and systematic error not below 0, correlation_s above 0, shares of "
                f"outliers and swaps 0 to 0.5; found {self}"
            )


def disturbed(
    places: np.ndarray,
    trial: Trial,
    labels: np.ndarray,
    how: Disturbances,
    marker_sd_m: float,
    rng: np.random.Generator,
    common: np.random.Generator,
) -> np.ndarray:
    """Return measured places (T, M, 2) with the disturbances added.

    Parameters
    ----------
    marker_sd_m : float
        White noise that is in them already.
    rng, common : Generator
        Of this trial; the same in every trial, for what repeats.
    """
    found = np.array(places)
    if how.correlated_sd_m:
        found += how.correlated_sd_m * _correlated(found.shape, labels, how.correlation_s, rng)
    if how.drift_m:
        found += how.drift_m * _creep(labels, rng)[:, None, :]
    if how.systematic_sd_m:
        found += how.systematic_sd_m * _systematic(found.shape, trial, labels, common)
    if how.outlier_share:
        chosen = rng.random(found.shape[:2]) < how.outlier_share
        count = int(chosen.sum())
        angle = rng.uniform(0, 2 * math.pi, count)
        nearest = LEAST_OUTLIER_SD * marker_sd_m
        size = rng.uniform(nearest, max(FARTHEST_OUTLIER_M, nearest), count)
        found[chosen] += size[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return _swapped(found, labels, how.swap_share, rng) if how.swap_share else found


def _correlated(
    shape: tuple[int, ...], labels: np.ndarray, correlation_s: float, rng: np.random.Generator
) -> np.ndarray:
    """Return unit noise (T, M, 2) with autocorrelation exp(-|dt|/correlation_s)."""
    fresh = rng.standard_normal(shape)
    found = np.empty(shape)
    found[0] = fresh[0]
    for k in range(1, len(labels)):
        kept = math.exp(-(labels[k] - labels[k - 1]) / correlation_s)
        found[k] = kept * found[k - 1] + math.sqrt(1 - kept**2) * fresh[k]
    return found


def _creep(labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a way (T, 2) from nothing to length 1, at a speed that rises or falls."""
    part = labels / max(labels[-1], 1e-9)
    way = part + rng.uniform(-0.5, 0.5) * part * (1 - part)
    angle = rng.uniform(0, 2 * math.pi)
    return np.asarray(way[:, None] * np.array([math.cos(angle), math.sin(angle)]))


def _systematic(
    shape: tuple[int, ...], trial: Trial, labels: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Return a smooth error (T, M, 2) of root mean square about 1 over the gaits.

    The first three shapes of the body times waves at multiples of the gait's frequency; half of every
    amplitude is common to all gaits, the rest varies with frequency, pressure and offset.
    """
    markers = shape[1]
    place = np.linspace(-1, 1, markers) if markers > 1 else np.zeros(1)
    shapes = [np.polynomial.Legendre.basis(k)(place) for k in range(min(3, markers))]
    gait = np.array(
        [1.0, (trial.frequency_hz - 1.5) / 0.5, (trial.pressure_kpa - 48) / 7, trial.offset / 0.4]
    )
    phase = 2 * math.pi * trial.frequency_hz * labels
    found = np.zeros(shape)
    for own in shapes:
        own = own / np.sqrt(np.mean(own**2))
        for harmonic in range(1, HARMONICS + 1):
            for wave in (np.cos(harmonic * phase), np.sin(harmonic * phase)):
                amplitude = rng.standard_normal((2, 4)) @ (gait / 2)
                found += wave[:, None, None] * own[:, None] * amplitude
    return np.asarray(found / math.sqrt(len(shapes) * HARMONICS))


def _swapped(places: np.ndarray, labels: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Return the places with the labels of two neighbours exchanged in `share` of the frames."""
    found, markers = np.array(places), places.shape[1]
    if markers < 2:
        return found
    length = max(1, round(SWAP_S / max(float(np.median(np.diff(labels))), 1e-6)))
    for start in range(length, len(labels) - length, length):  # the first frames are in order
        if rng.random() < share:
            i = int(rng.integers(markers - 1))
            found[start : start + length, [i, i + 1]] = found[start : start + length, [i + 1, i]]
    return found


WRONG_ENTRIES = ("phase_sign", "frequency", "other_robot")


def mistaken(trials: list[Trial], kind: str, rng: np.random.Generator) -> tuple[list[Trial], int, Factors]:
    """Return the trials as the notebook has them, which one is wrong, and the factors of its robot.

    ``phase_sign``: the wave travels the other way than noted; ``frequency``: it ran at another than noted;
    ``other_robot``: friction across 0.6 and curvature 0.8 times the others'.
    """
    if kind not in WRONG_ENTRIES:
        raise LabError(f"wrong entry: expected one of {', '.join(WRONG_ENTRIES)}, found '{kind}'")
    index = int(rng.integers(len(trials)))
    noted, true = list(trials), trials[index]
    if kind == "phase_sign":
        noted[index] = replace(true, phase_lag_rad=-true.phase_lag_rad)
    if kind == "frequency":
        noted[index] = replace(
            true, frequency_hz=true.frequency_hz * (1.5 if true.frequency_hz < 1.4 else 0.5)
        )
    return noted, index, OTHER_ROBOT if kind == "other_robot" else Factors()

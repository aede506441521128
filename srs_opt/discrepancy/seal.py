"""Step 11: the gap on trials that no fit saw, before and after, beside the noise floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.calibrate.fit import CORRELATED, Experiment, Fit, Point
from srs_opt.measurement.records import Trial

BLOCK_S = 0.5
DRAWS = 2000
PASSED = 0.25  # a named effect must close at least three quarters of the gap


@dataclass(frozen=True)
class Gap:
    """Root mean square distance between model and data on the sealed trials, per coordinate.

    Every trial may use its own friction and curvature within the scatter, for both models alike.

    Attributes
    ----------
    calibrated, with_effect, noise_floor : float
        Metres.
    ratio : float or None
        (with_effect - noise_floor)/(calibrated - noise_floor); None without a gap to close.
    interval : (float, float) or None
        Of the ratio, 90 %, by resampling half-second blocks.
    trials : int
    """

    calibrated: float
    with_effect: float
    noise_floor: float
    ratio: float | None
    interval: tuple[float, float] | None
    trials: int

    @property
    def passed(self) -> bool:
        """Whether the effect closes the gap."""
        return self.ratio is not None and self.ratio <= PASSED


def sealed_residuals(experiment: Experiment, fit: Fit, trials: Sequence[Trial]) -> list[np.ndarray]:
    """Return the residuals (T, 2 M) of every trial at the fit, with the trial's own most probable scatter."""
    found = []
    for trial in trials:
        point = Point(fit.point.values, {})
        for _ in range(3):
            gram = experiment.gram(trial, point, fit.coordinates)
            excess = gram.misfit / gram.count - 1 - 4 * np.sqrt(2 / gram.count)
            back = gram.eliminated(1 + CORRELATED * max(0.0, excess)).back
            now = point.scatter.get(trial.name, np.zeros(back.shape[0]))
            moved = np.clip(now + back[:, -1], -4 * gram.scatter_sd, 4 * gram.scatter_sd)
            if np.abs(moved - now).max() < 0.05 * gram.scatter_sd.min():
                break
            point = Point(fit.point.values, {trial.name: moved})
        found.append(experiment.residual(trial, experiment.predict(trial, point)))
    return found


def open_seal(
    experiment: Experiment, before: Fit, after: Fit, trials: Sequence[Trial], seed: int = 0
) -> Gap | None:
    """Return the gap before and after, or None without sealed trials."""
    if not trials:
        return None
    residuals = [sealed_residuals(experiment, f, trials) for f in (before, after)]
    floor = experiment.sd_m
    blocks = _blocks(trials, residuals)
    rng = np.random.default_rng([seed, 23])
    ratio, interval = _ratio(blocks.sum(axis=0), floor), None
    drawn = [
        _ratio(blocks[rng.integers(len(blocks), size=len(blocks))].sum(axis=0), floor) for _ in range(DRAWS)
    ]
    usable = np.array([r for r in drawn if r is not None])
    if ratio is not None and usable.size > DRAWS // 2:
        low, high = np.quantile(usable, [0.05, 0.95])
        interval = (float(low), float(high))
    total = blocks.sum(axis=0)
    sizes = np.sqrt(total[:2] / total[2])
    return Gap(float(sizes[0]), float(sizes[1]), floor, ratio, interval, len(trials))


def _blocks(trials: Sequence[Trial], residuals: list[list[np.ndarray]]) -> np.ndarray:
    """Return sums of squares before and after and their count, per half second of each trial, (B, 3)."""
    rows = []
    for trial, before, after in zip(trials, *residuals):
        number = np.floor(trial.time_s / BLOCK_S).astype(int)
        for k in np.unique(number):
            b, a = before[number == k], after[number == k]
            rows.append((np.nansum(b**2), np.nansum(a**2), np.isfinite(b).sum()))
    return np.array(rows, dtype=float)


def _ratio(total: np.ndarray, floor: float) -> float | None:
    before, after = np.sqrt(total[:2] / max(total[2], 1.0))
    if before - floor <= 0.02 * floor:
        return None
    return float((after - floor) / (before - floor))

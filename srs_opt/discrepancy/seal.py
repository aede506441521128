"""Step 11: the gap on trials that no fit saw, before and after, beside the noise floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.calibrate.coordinates import SCATTER_SD
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit import Fit
from srs_opt.calibrate.objective import CORRELATED
from srs_opt.measurement.records import Trial

BLOCK_S = 0.5
DRAWS = 2000
PASSED = 0.25  # a named effect must close at least three quarters of the gap ...
NEARLY = 0.5  # ... or, where the interval reaches that far, half of it
CORRELATION_S = 1 / 60  # misfit lasts longer than this, noise not a single frame


@dataclass(frozen=True)
class Gap:
    """Root mean square distance between model and data on the sealed trials, per coordinate.

    Every trial may use its own friction and curvature within the scatter, for both models alike.

    Attributes
    ----------
    calibrated, with_effect, noise_floor : float
        Metres. The floor is what of the residuals with the effect is not repeated by the frames after: noise
        is independent from frame to frame, misfit is not.
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
        if self.ratio is None or self.interval is None:
            return False
        return self.ratio <= PASSED or (self.interval[0] <= PASSED and self.ratio <= NEARLY)

    @property
    def closed_in_part(self) -> bool:
        """Whether the effect closes some of the gap beyond doubt."""
        return self.interval is not None and self.interval[1] < 1.0


def sealed_residuals(experiment: Experiment, fit: Fit, trials: Sequence[Trial]) -> list[np.ndarray]:
    """Return the residuals (T, 2 M) of every trial at the fit, with the trial's own most probable scatter."""
    own = [c for c in fit.coordinates if c.name in SCATTER_SD]
    point = Point(fit.point.values, {})
    for _ in range(3):
        grams = experiment.grams(point, own, trials)
        moved, settled = {}, True
        for trial in trials:
            gram = grams[trial.name]
            excess = gram.misfit / gram.count - 1 - 4 * np.sqrt(2 / gram.count)
            back = gram.eliminated(1 + CORRELATED * max(0.0, excess)).back
            now = point.scatter.get(trial.name, np.zeros(back.shape[0]))
            moved[trial.name] = np.clip(now + back[:, -1], -4 * gram.scatter_sd, 4 * gram.scatter_sd)
            settled &= bool(np.abs(moved[trial.name] - now).max() < 0.05 * gram.scatter_sd.min())
        if settled:
            break
        point = Point(fit.point.values, moved)
    return experiment.residuals(trials, point)


def open_seal(
    experiment: Experiment, before: Fit, after: Fit, trials: Sequence[Trial], seed: int = 0
) -> Gap | None:
    """Return the gap before and after, or None without sealed trials."""
    if not trials:
        return None
    residuals = [sealed_residuals(experiment, f, trials) for f in (before, after)]
    blocks = _blocks(trials, residuals)
    rng = np.random.default_rng([seed, 23])
    total = blocks.sum(axis=0)
    ratio, interval = _ratio(total), None
    drawn = [_ratio(blocks[rng.integers(len(blocks), size=len(blocks))].sum(axis=0)) for _ in range(DRAWS)]
    usable = np.array([r for r in drawn if r is not None])
    if ratio is not None and usable.size > DRAWS // 2:
        low, high = np.quantile(usable, [0.05, 0.95])
        interval = (float(low), float(high))
    return Gap(*_sizes(total), ratio, interval, len(trials))


def _blocks(trials: Sequence[Trial], residuals: list[list[np.ndarray]]) -> np.ndarray:
    """Return per half second of each trial, (B, 5): sums of squares before and after, their count; the sum
    of products of residuals after and of those a few frames later, and their count."""
    rows = []
    for trial, before, after in zip(trials, *residuals):
        number = np.floor(trial.time_s / BLOCK_S).astype(int)
        products = _products(after, _lags(trial))
        for k in np.unique(number):
            b, a, c = before[number == k], after[number == k], products[:, number == k]
            row = (np.nansum(b**2), np.nansum(a**2), np.isfinite(b).sum(), np.nansum(c), np.isfinite(c).sum())
            rows.append(row)
    return np.array(rows, dtype=float)


def _lags(trial: Trial) -> int:
    frame = float(np.median(np.diff(trial.time_s))) if trial.time_s.size > 1 else CORRELATION_S
    return max(1, int(CORRELATION_S / frame + 1e-6))


def _products(residual: np.ndarray, lags: int) -> np.ndarray:
    """Return products of residuals (T, n) with those 1 ... `lags` frames later, (lags, T, n), NaN beyond."""
    found = np.full((lags, *residual.shape), np.nan)
    for lag in range(1, min(lags, residual.shape[0] - 1) + 1):
        found[lag - 1, :-lag] = residual[lag:] * residual[:-lag]
    return found


def _sizes(total: np.ndarray) -> tuple[float, float, float]:
    """Return the root mean squares before and after, and the noise floor."""
    before, after = total[:2] / max(total[2], 1.0)
    repeated = total[3] / max(total[4], 1.0)
    return float(np.sqrt(before)), float(np.sqrt(after)), float(np.sqrt(max(after - repeated, 0.0)))


def _ratio(total: np.ndarray) -> float | None:
    before, after, floor = _sizes(total)
    if before - floor <= 0.02 * floor:
        return None
    return (after - floor) / (before - floor)

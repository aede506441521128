"""Step 11: the gap on trials that no fit saw, before and after, beside the noise floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.calibrate.experiment import Experiment
from srs_opt.calibrate.fit import Fit
from srs_opt.calibrate.outlying_trials import own_scatter
from srs_opt.discrepancy.gap_settings import SEAL
from srs_opt.discrepancy.motions import motion_errors
from srs_opt.discrepancy.settings import ADEQUACY, AdequacySettings
from srs_opt.measurement.records import Trial


@dataclass(frozen=True)
class Remainder:
    """What a model leaves on the sealed trials beyond the noise.

    Attributes
    ----------
    m : float
        Root mean square per coordinate, metres.
    speed_share, radius_share : float or None
        Errors of the predicted speed and radius over the measured ones; None where no trial tells.
    by_trial : dict
        Trial name -> as `m`.
    """

    m: float
    speed_share: float | None
    radius_share: float | None
    by_trial: dict[str, float]


@dataclass(frozen=True)
class Gap:
    """Root mean square distance between model and data on the sealed trials, per coordinate.

    Every trial may use its own friction and curvature within the scatter, for all models alike.

    Attributes
    ----------
    calibrated, with_effect, noise_floor : float
        Metres. The floor is what of the residuals with the effect is not repeated by the frames after: noise
        is independent from frame to frame, misfit is not; and what the noise model knows to be correlated.
    ratio : float or None
        (with_effect - noise_floor)/(calibrated - noise_floor); None without a gap to close.
    interval : (float, float) or None
        Of the ratio, 90 %, by resampling half-second blocks.
    trials : int
    before, after : Remainder
        What calibration alone and the best set of effects leave.
    floor_error_m : float
        What a remainder may be by chance.
    rival_m : float or None
        What the best rival set leaves.
    """

    calibrated: float
    with_effect: float
    noise_floor: float
    ratio: float | None
    interval: tuple[float, float] | None
    trials: int
    before: Remainder
    after: Remainder
    floor_error_m: float = 0.0
    rival_m: float | None = None

    @property
    def share(self) -> float | None:
        """Share of the gap that the best set of effects leaves; None without a gap to close."""
        return None if self.ratio is None or self.before.m == 0 else self.after.m / self.before.m

    @property
    def lead(self) -> float | None:
        """Share of the gap that the best rival leaves, less that of the best; None without a rival."""
        if self.share is None or self.rival_m is None:
            return None
        return self.rival_m / self.before.m - self.share

    @property
    def closed_in_part(self) -> bool:
        """Whether the effect closes some of the gap beyond doubt."""
        return self.interval is not None and self.interval[1] < 1.0


def sealed_residuals(experiment: Experiment, fit: Fit, trials: Sequence[Trial]) -> list[np.ndarray]:
    """Return the residuals (T, 2 M) of every trial at the fit, with the trial's own most probable scatter."""
    return experiment.residuals(trials, own_scatter(experiment, fit, trials))


def open_seal(
    experiment: Experiment,
    before: Fit,
    after: Fit,
    trials: Sequence[Trial],
    seed: int = 0,
    rival: Fit | None = None,
) -> Gap | None:
    """Return the gap before and after, or None without sealed trials.

    Parameters
    ----------
    rival : Fit, optional
        Of the best set of effects that is not a part of the best.
    """
    if not trials:
        return None
    first = sealed_residuals(experiment, before, trials)
    second = first if after is before else sealed_residuals(experiment, after, trials)
    correlated_m, length_m = experiment.noise.correlated_sd_m, experiment.model.robot.length_m
    blocks = _blocks(trials, [first, second])
    # a stream of its own: the draws do not depend on what else is drawn from the seed
    rng = np.random.default_rng([seed, 23])
    total = blocks.sum(axis=0)
    sizes = _sizes(total, correlated_m)
    ratio, interval = _ratio(sizes), None
    drawn = [
        # whole blocks are drawn: residuals within half a second are not independent
        _ratio(_sizes(blocks[rng.integers(len(blocks), size=len(blocks))].sum(axis=0), correlated_m))
        for _ in range(SEAL.draws)
    ]
    usable = np.array([r for r in drawn if r is not None])
    if ratio is not None and usable.size > SEAL.draws // 2:
        low, high = np.quantile(usable, [0.05, 0.95])
        interval = (float(low), float(high))
    rival_m = None
    if rival is not None and ratio is not None:
        rival_m = _remainder(trials, sealed_residuals(experiment, rival, trials), correlated_m, length_m).m
    remainders = [_remainder(trials, r, correlated_m, length_m) for r in (first, second)]
    # what a mean product of independent noise is by chance (sd^2/sqrt(n)), times four, as a root mean square
    error = sizes[2] * float(np.sqrt(4 / np.sqrt(max(total[4], 1.0))))
    return Gap(*sizes, ratio, interval, len(trials), remainders[0], remainders[1], error, rival_m)


def odd_sealed(gap: Gap | None, settings: AdequacySettings = ADEQUACY) -> dict[str, str]:
    """Return the few sealed trials that the best model misses by far more than the others, and why.

    A wrong entry in a notebook spoils one trial; what the model lacks shows in several.
    """
    if gap is None or gap.trials < 2:
        return {}
    left = gap.after.by_trial
    # of two trials the one that is missed less is the measure
    usual = float(np.median(list(left.values()))) if gap.trials > 2 else min(left.values())
    limit = max(settings.off_m, settings.off_times * max(usual, gap.floor_error_m))
    off = {n: m for n, m in left.items() if m > limit}
    if not off or len(off) > max(1, gap.trials // 4):
        return {}
    return {
        n: f"sealed; the model that predicts the others within {1e3 * usual:.2g} mm misses it by "
        f"{1e3 * m:.2g} mm: look at its entry in the notebook"
        for n, m in off.items()
    }


def _remainder(
    trials: Sequence[Trial], residuals: Sequence[np.ndarray], correlated_m: float, length_m: float
) -> Remainder:
    """Return what residuals hold beyond the noise: what the frames after repeat."""
    sums = [np.array([np.nansum(p), np.isfinite(p).sum()]) for p in map(_repeated, trials, residuals)]
    by_trial = {t.name: _beyond(s, correlated_m) for t, s in zip(trials, sums)}
    return Remainder(
        _beyond(np.sum(sums, axis=0), correlated_m), *motion_errors(trials, residuals, length_m), by_trial
    )


def _beyond(sums: np.ndarray, correlated_m: float) -> float:
    return float(np.sqrt(max(sums[0] / max(sums[1], 1.0) - correlated_m**2, 0.0)))


def _blocks(trials: Sequence[Trial], residuals: list[list[np.ndarray]]) -> np.ndarray:
    """Return per half second of each trial, (B, 5): sums of squares before and after, their count; the sum
    of products of residuals after and of those a few frames later, and their count."""
    rows = []
    for trial, before, after in zip(trials, *residuals):
        number = np.floor(trial.time_s / SEAL.block_s).astype(int)
        products = _repeated(trial, after)
        for k in np.unique(number):
            b, a, c = before[number == k], after[number == k], products[:, number == k]
            row = (np.nansum(b**2), np.nansum(a**2), np.isfinite(b).sum(), np.nansum(c), np.isfinite(c).sum())
            rows.append(row)
    return np.array(rows, dtype=float)


def _repeated(trial: Trial, residual: np.ndarray) -> np.ndarray:
    """Return products of residuals (T, n) with those 1 ... some frames later, (lags, T, n), NaN beyond."""
    frame = float(np.median(np.diff(trial.time_s))) if trial.time_s.size > 1 else SEAL.correlation_s
    lags = max(1, int(SEAL.correlation_s / frame + 1e-6))
    found = np.full((lags, *residual.shape), np.nan)
    for lag in range(1, min(lags, residual.shape[0] - 1) + 1):
        found[lag - 1, :-lag] = residual[lag:] * residual[:-lag]
    return found


def _sizes(total: np.ndarray, correlated_m: float) -> tuple[float, float, float]:
    """Return the root mean squares before and after, and the noise floor."""
    before, after = total[:2] / max(total[2], 1.0)
    repeated = total[3] / max(total[4], 1.0)
    # mean square less what later frames repeat is white noise; of the repeated part the known colour is
    # noise, too
    floor = max(after - repeated, 0.0) + min(correlated_m**2, max(repeated, 0.0))
    return float(np.sqrt(before)), float(np.sqrt(after)), float(np.sqrt(floor))


def _ratio(sizes: tuple[float, float, float]) -> float | None:
    before, after, floor = sizes
    # of a gap that drowns in the noise no share can be told
    if before - floor <= SEAL.measurable_share * floor:
        return None
    return (after - floor) / (before - floor)

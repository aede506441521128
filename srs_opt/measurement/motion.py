"""Speed, turn rate and radius of a trial, with confidence intervals.

A steady gait is fitted to all phases of the last whole cycles (`srs_opt.measurement.steady_fit`); the
transient is left out automatically; intervals come from leaving out one cycle at a time (jackknife;
half a cycle when there are fewer than four), so that they hold whatever the correlation within a block.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.fit_settings import STEADY
from srs_opt.measurement.records import DataSet, MapRow, Trial
from srs_opt.measurement.steady_fit import Complex, SteadyFit, fit_steady


@dataclass(frozen=True)
class Interval:
    """An estimate with its standard deviation and confidence interval (None: too few cycles to tell)."""

    value: float
    sd: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Motion:
    """Steady motion of one trial.

    Attributes
    ----------
    trial : str
    speed_m_s, turn_rate_rad_s : Interval
        Turn rate positive to the left.
    radius_m : Interval or None
        Signed (+ left); None when straight: the turn rate's interval holds 0, or the radius is beyond
        `SteadyMotionSettings.straight_lengths` robot lengths.
    cycles : int
        Whole cycles used.
    from_s, to_s : float
        Time window used; what comes before is transient.
    settled : bool
        False when even the second half of the trial still changes from cycle to cycle.
    residual_m : float
        Root mean square gap to an exactly periodic gait, per coordinate.
    """

    trial: str
    speed_m_s: Interval
    turn_rate_rad_s: Interval
    radius_m: Interval | None
    cycles: int
    from_s: float
    to_s: float
    settled: bool
    residual_m: float


def trial_motion(
    trial: Trial,
    marker_sd_m: float,
    length_m: float,
    confidence: float = 0.95,
    harmonics: int | None = None,
) -> Motion:
    """Return the steady motion of `trial`.

    Parameters
    ----------
    trial : Trial
        Marker tracks (labels in order) or a centre-of-mass track.
    marker_sd_m : float
        Of one coordinate.
    length_m : float
        Length of the robot; scale for "straight".
    confidence : float
        Of the intervals.
    harmonics : int
        Of the valve frequency in the cycle's shape.

    Raises
    ------
    InputError
        If the trial is not a gait, lasts fewer than three cycles, or shows too few markers.
    """
    time, tracks = trial.time_s, _tracks(trial)
    period = trial.period_s
    whole = math.floor((float(time[-1] - time[0]) + 1e-9) / period) if math.isfinite(period) else 0
    if whole < STEADY.least_cycles + 1:
        raise InputError(
            f"trial '{trial.name}': {whole} whole cycles; steady motion needs {STEADY.least_cycles + 1} "
            "or more"
        )
    harmonics = STEADY.harmonics if harmonics is None else harmonics
    # four samples per shortest wave at least
    harmonics = max(1, min(harmonics, int(period / float(np.median(np.diff(time))) / 4)))
    end = float(time[-1])
    cycles, settled = _settled_cycles(time, tracks, period, whole, harmonics, marker_sd_m)
    window = time >= end - cycles * period - 1e-9
    fit = fit_steady(time[window], tracks[window], period, harmonics)
    blocks = _blocks(time[window], end, period, cycles)
    replicas = _jackknife(time[window], tracks[window], period, harmonics, blocks)
    speed = _interval(fit.speed_m_s, [f.speed_m_s for f in replicas], confidence)
    rate = _interval(fit.turn_rate_rad_s, [f.turn_rate_rad_s for f in replicas], confidence)
    return Motion(
        trial=trial.name,
        speed_m_s=speed,
        turn_rate_rad_s=rate,
        radius_m=_radius(fit, replicas, rate, confidence, length_m),
        cycles=cycles,
        from_s=end - cycles * period,
        to_s=end,
        settled=settled,
        residual_m=fit.variance_m2**0.5,
    )


def _tracks(trial: Trial) -> Complex:
    points = trial.markers_m if trial.markers_m is not None else trial.centre_m
    if points is None or trial.kind != "gait":
        raise InputError(f"trial '{trial.name}' is a {trial.kind} trial without a gait's track")
    points = points if points.ndim == 3 else points[:, None]
    seen = np.isfinite(points[..., 0]).mean(axis=0)
    points = points[:, seen > 0.05]
    if not points.shape[1]:
        raise InputError(f"trial '{trial.name}': hardly any marker was seen")
    return np.asarray(points[..., 0] + 1j * points[..., 1])


def _settled_cycles(
    time: np.ndarray, tracks: Complex, period: float, whole: int, harmonics: int, sd: float
) -> tuple[int, bool]:
    """Return how many of the last cycles are steady, by the misfit of a steady gait to them.

    The most cycles are taken whose misfit is not above that of the second half (or of the camera's noise,
    where that is larger) at the 99 % level; the first cycle, which starts from rest, is never used.
    """
    from scipy.stats import norm

    fewest = max(STEADY.least_cycles, whole // 2)
    floor, fits = 0.0, {}
    for cycles in range(fewest, whole):
        window = time >= time[-1] - cycles * period - 1e-9
        fits[cycles] = fit_steady(time[window], tracks[window], period, harmonics)
        floor = max(fits[fewest].variance_m2, sd**2)
        if cycles > fewest and fits[cycles].variance_m2 > floor * _headroom(
            fits[cycles].freedom, norm.ppf(STEADY.settled_level)
        ):
            cycles -= 1
            break
    settled = fits[fewest].variance_m2 <= STEADY.settled_variance * sd**2 if sd > 0 else True
    return cycles, bool(settled)


def _headroom(freedom: float, quantile: float) -> float:
    """Return how far above 1 a mean square may come by chance (variance 2 / freedom)."""
    return 1 + quantile * math.sqrt(2 / max(freedom, 1.0))


def _blocks(time: np.ndarray, end: float, period: float, cycles: int) -> np.ndarray:
    """Return the block (whole cycles from the end; half cycles when there are few) of every sample."""
    count = min(cycles if cycles >= STEADY.least_blocks else 2 * cycles, STEADY.most_blocks)
    number = np.floor((end - time) / period * count / cycles + 1e-9).astype(int)
    # samples on the outer edges belong to the first and last block
    interval: np.ndarray = np.clip(number, 0, count - 1)
    return interval


def _jackknife(
    time: np.ndarray, tracks: Complex, period: float, harmonics: int, blocks: np.ndarray
) -> list[SteadyFit]:
    count = int(blocks.max()) + 1
    if count < 3:
        return []
    return [fit_steady(time[blocks != b], tracks[blocks != b], period, harmonics) for b in range(count)]


def _interval(value: float, replicas: list[float], confidence: float) -> Interval:
    if len(replicas) < 3:
        return Interval(value, None, None, None)
    from scipy.stats import t as student

    count = len(replicas)
    # delete-a-group jackknife
    sd = math.sqrt((count - 1) / count * float(((np.array(replicas) - np.mean(replicas)) ** 2).sum()))
    reach = float(student.ppf(0.5 + confidence / 2, count - 1)) * sd
    return Interval(value, sd, value - reach, value + reach)


def _radius(
    fit: SteadyFit, replicas: list[SteadyFit], rate: Interval, confidence: float, length_m: float
) -> Interval | None:
    """Return the signed radius; its interval is that of the path's curvature, inverted."""
    bend = _interval(fit.curvature_1_m, [f.curvature_1_m for f in replicas], confidence)
    straight = rate.low is not None and rate.high is not None and rate.low <= 0 <= rate.high
    if straight or abs(bend.value) * STEADY.straight_lengths * length_m < 1:
        return None
    value = 1 / bend.value
    if bend.sd is None or bend.low is None or bend.high is None:
        return Interval(value, None, None, None)
    if bend.low <= 0 <= bend.high:
        return Interval(value, bend.sd * value**2, None, None)
    # sd(1/k) = sd(k)/k^2 to first order; the interval's ends are inverted themselves
    return Interval(value, bend.sd * value**2, *sorted((1 / bend.low, 1 / bend.high)))


def dataset_motions(dataset: DataSet, confidence: float = 0.95) -> tuple[Motion, ...]:
    """Return the steady motion of every gait trial of a data set."""
    sd, length = dataset.marker_sd_m, dataset.robot.length_m
    return tuple(trial_motion(t, sd, length, confidence) for t in dataset.trials if t.kind == "gait")


def motion_map(dataset: DataSet, motions: tuple[Motion, ...] | None = None) -> tuple[MapRow, ...]:
    """Return one row per gait, replicates averaged (paper, Figs. 8 and 9).

    Standard deviations are those between replicates; with a single run, that of the run's estimate (0 when
    even that is unknown). Trials with valve schedules are left out: a map's axes do not describe them.
    """
    found = {m.trial: m for m in (dataset_motions(dataset) if motions is None else motions)}
    groups: dict[tuple[float, float, float, float], list[Motion]] = {}
    for trial in dataset.trials:
        if trial.name in found and trial.schedule is None and trial.applied is None:
            # settings that were typed in twice are equal but for rounding
            key = (trial.frequency_hz, trial.pressure_kpa, trial.offset, trial.phase_lag_rad)
            groups.setdefault(tuple(round(v, 6) for v in key), []).append(found[trial.name])  # type: ignore[arg-type]
    return tuple(_map_row(key, group) for key, group in sorted(groups.items()))


def _map_row(key: tuple[float, float, float, float], group: list[Motion]) -> MapRow:
    speed, speed_sd = _spread([m.speed_m_s for m in group])
    turning = [m.radius_m for m in group if m.radius_m is not None]
    radius, radius_sd = _spread(turning) if 2 * len(turning) > len(group) else (None, None)
    return MapRow(*key, speed or 0.0, speed_sd or 0.0, radius, radius_sd, len(group))


def _spread(values: list[Interval]) -> tuple[float | None, float | None]:
    numbers = np.array([v.value for v in values])
    if len(numbers) > 1:
        return float(numbers.mean()), float(numbers.std(ddof=1))
    return float(numbers[0]), values[0].sd

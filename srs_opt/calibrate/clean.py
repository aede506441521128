"""Outlying positions: exchanged labels are put right, and what lies far off is left out.

Both are judged by the tracks alone, not by a model's residuals: what a model cannot explain stays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from srs_opt.calibrate.data_settings import CLEANING
from srs_opt.calibrate.noise import track_of
from srs_opt.measurement.chain import chain_of
from srs_opt.measurement.labels import correct_labels
from srs_opt.measurement.noise import MAD
from srs_opt.measurement.records import Array, DataSet, Trial
from srs_opt.robot import Robot


@dataclass(frozen=True)
class CleanedTracks:
    """What was done to the tracks of a data set.

    Attributes
    ----------
    dataset : DataSet
    outliers, swapped : dict
        Trial -> positions left out, frames whose labels were put right; trials without are not in it.
    seen : int
        Positions before.
    """

    dataset: DataSet
    outliers: dict[str, int]
    swapped: dict[str, int]
    seen: int

    @property
    def outlier_share(self) -> float:
        """Share of all positions that was left out."""
        return sum(self.outliers.values()) / max(self.seen, 1)


def cleaned(dataset: DataSet) -> CleanedTracks:
    """Return the data set with exchanged labels put right and outliers taken for lost."""
    trials, outliers, swapped, seen = [], {}, {}, 0
    for trial in dataset.trials:
        track = track_of(trial)
        if track is None:
            trials.append(trial)
            continue
        trial, count = _relabelled(dataset.robot, trial)
        if count:
            swapped[trial.name] = count
        points = track.reshape(len(track), -1, 2) if trial.markers_m is None else trial.markers_m
        seen += int(np.isfinite(points[..., 0]).sum())
        outlying = outliers_of(points, trial.time_s)
        if outlying.any():
            outliers[trial.name] = int(outlying.sum())
            points = np.where(outlying[..., None], np.nan, points)
            trial = _with_points(trial, points)
        trials.append(trial)
    return CleanedTracks(replace(dataset, trials=tuple(trials)), outliers, swapped, seen)


def _relabelled(robot: Robot, trial: Trial) -> tuple[Trial, int]:
    if trial.markers_m is None or trial.markers_m.shape[1] < 2:
        return trial, 0
    chain = chain_of(robot, trial.spots)
    if trial.markers_m.shape[1] != chain.markers:
        return trial, 0
    found = correct_labels(chain, trial.markers_m)
    count = int(found.swapped.sum())
    return (replace(trial, markers_m=found.markers_m), count) if count else (trial, 0)


def _with_points(trial: Trial, points: Array) -> Trial:
    if trial.markers_m is not None:
        return replace(trial, markers_m=points)
    return replace(trial, centre_m=points[:, 0])


def outliers_of(points: Array, time_s: Array) -> np.ndarray:
    """Return which positions (T, M, 2) lie far from the parabola through those just before and after, (T, M).

    The farthest of its neighbourhood is left out first, then the parabolas are drawn anew.
    """
    frames, markers = points.shape[:2]
    outlying = np.zeros((frames, markers), dtype=bool)
    if frames < 4 * CLEANING.least_frames:
        return outlying
    frame_s = float(np.median(np.diff(time_s)))
    reach = CLEANING.least_frames
    if frame_s > 0:
        reach = int(np.clip(round(CLEANING.reach_s / frame_s), reach, CLEANING.most_frames))
    off, sure = _off_parabola(points, reach)
    size = np.where(sure, np.max(np.abs(off), axis=2), 0.0)
    if not sure.any():
        return outlying
    # where a quiet camera sees a quick motion, its parabolas are off by more than the noise
    usual = np.median(np.abs(off[sure])) / MAD
    limit = CLEANING.outlier_sd * np.maximum(usual, _usual_nearby(size, CLEANING.neighbourhood * reach))
    some = np.arange(markers)
    for _ in range(CLEANING.passes):
        # an outlier bends its neighbours' parabolas, too: only the worst nearby is sure
        found = (size >= _largest_nearby(size, reach)) & (size > limit[:, some])
        outlying[:, some] |= found
        # only where something was left out the parabolas change
        again = found.any(axis=0)
        some = some[again]
        if not some.size:
            break
        off, sure = _off_parabola(np.where(outlying[:, some, None], np.nan, points[:, some]), reach)
        size = np.where(sure, np.max(np.abs(off), axis=2), 0.0)
    return outlying


def _usual_nearby(size: Array, reach: int) -> Array:
    from scipy.ndimage import median_filter

    return np.asarray(median_filter(size, (2 * reach + 1, 1), mode="nearest"))


def _largest_nearby(size: Array, reach: int) -> Array:
    from scipy.ndimage import maximum_filter1d

    return np.asarray(maximum_filter1d(size, 2 * reach + 1, axis=0, mode="constant"))


def _off_parabola(points: Array, reach: int) -> tuple[Array, np.ndarray]:
    """Return standardised distances (T, M, 2) from the neighbours' parabola, and where there is one (T, M).

    Least squares over the seen frames within reach, the point's own left out.
    """
    from scipy.ndimage import correlate1d

    seen = np.isfinite(points[..., 0])
    weight, value = seen.astype(float), np.where(seen[..., None], points, 0.0)
    lag = np.arange(-reach, reach + 1) / reach
    others = (lag != 0).astype(float)

    def summed(data: Array, power: int) -> Array:
        return np.asarray(correlate1d(data, others * lag**power, axis=0, mode="constant"))

    # all parabolas at once: sums over neighbours are correlations with powers of the lag
    moments = [summed(weight, k) for k in range(5)]
    normal = np.stack([np.stack([moments[i + j] for j in range(3)], axis=-1) for i in range(3)], axis=-2)
    count = moments[0]
    # a parabola is asked between its neighbours, not beyond them
    both_sides = (correlate1d(weight, (lag < 0) * 1.0, axis=0, mode="constant") >= 1) & (
        correlate1d(weight, (lag > 0) * 1.0, axis=0, mode="constant") >= 1
    )
    sure = seen & both_sides & (count >= 4)
    # so that all can be inverted at once; these are not looked at
    normal[~sure] = np.eye(3)
    inverse = np.linalg.inv(normal)
    right = np.stack([summed(value, k) for k in range(3)], axis=-1)
    expected = np.einsum("tmk,tmck->tmc", inverse[..., 0, :], right)
    # variance of a value less its prediction: its own noise and the parabola's at lag 0
    spread = np.sqrt(1 + np.maximum(inverse[..., 0, 0], 0.0))
    return np.where(sure[..., None], (value - expected) / spread[..., None], 0.0), sure

"""What a residual means for who drives the robot: by how much the predicted speed and radius are wrong."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from srs_opt.calibrate.noise import track_of
from srs_opt.discrepancy.gap_settings import SEAL
from srs_opt.geometry import turn_onto
from srs_opt.measurement.records import Trial


def motion_errors(
    trials: Sequence[Trial],
    residuals: Sequence[np.ndarray],
    length_m: float,
    tracks: Sequence[np.ndarray] | None = None,
) -> tuple[float | None, float | None]:
    """Return the root mean square errors of predicted speed and radius over the measured ones.

    Both are taken from what moves from each instant to one gait cycle later, measured and predicted alike, so
    that the start from rest counts in both.

    Parameters
    ----------
    trials : sequence of Trial
    residuals : sequence of array (T, 2 M)
        Measured minus predicted.
    length_m : float
        Of the robot.
    tracks : sequence of array (T, 2 M), optional
        Default: those of the trials.

    Returns
    -------
    (float or None, float or None)
        None where no trial advances (or turns) enough to tell.
    """
    speeds, radii = [], []
    least_step_m = SEAL.least_step_body * length_m
    measured_tracks = [track_of(t) for t in trials] if tracks is None else tracks
    for trial, track, residual in zip(trials, measured_tracks, residuals):
        if track is None:
            continue
        measured = _advance(trial, track)
        predicted = _advance(trial, track - residual)
        if measured is None or predicted is None or measured[0] < least_step_m:
            continue
        speeds.append(predicted[0] / measured[0] - 1)
        cycles = (trial.time_s[-1] - trial.time_s[0]) / trial.period_s
        if abs(measured[1]) * cycles >= SEAL.least_turn_rad and predicted[1] != 0:
            # radius = speed / turn rate
            radii.append(predicted[0] / measured[0] * measured[1] / predicted[1] - 1)
    return _root_mean_square(speeds), _root_mean_square(radii)


def _root_mean_square(values: Sequence[float]) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if values else None


def _advance(trial: Trial, track: np.ndarray) -> tuple[float, float] | None:
    """Return advance (m) and turn (rad) per gait cycle, averaged over the trial."""
    frame_s = float(np.median(np.diff(trial.time_s)))
    if not math.isfinite(trial.period_s):
        return None
    cycle = round(trial.period_s / frame_s)
    if not 0 < cycle <= len(track) // 2:
        return None
    places = track[:, 0::2] + 1j * track[:, 1::2]
    now, then = places[:-cycle], places[cycle:]
    # only markers seen at both instants, or the mean would jump with them
    both = np.isfinite(now) & np.isfinite(then)
    seen = both.sum(axis=1)
    now, then = (np.where(both, z, 0.0) for z in (now, then))
    frames = seen > 0
    centres = [z.sum(axis=1)[frames] / seen[frames] for z in (now, then)]
    advance = float(np.abs(centres[1] - centres[0]).mean()) if frames.any() else 0.0
    if places.shape[1] > 1:
        bodies = [
            np.where(both, z - (z.sum(axis=1) / np.maximum(seen, 1))[:, None], 0.0) for z in (now, then)
        ]
        turn = float(turn_onto(bodies[0], bodies[1]))
    else:
        step = np.where(frames, then[:, 0] - now[:, 0], 0.0)
        turn = float(turn_onto(step[:-cycle], step[cycle:])) if len(step) > cycle else 0.0
    return advance, turn

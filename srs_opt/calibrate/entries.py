"""Whether a trial's track shows the gait that its entry says: frequency, and which way the wave travels.

Both are read from how the body bends, without any model: no effect changes them.
"""

from __future__ import annotations

import math

import numpy as np

from srs_opt.calibrate.data_settings import ENTRY
from srs_opt.geometry import turning_angles
from srs_opt.measurement.records import Trial


def contradicted(trial: Trial) -> str:
    """Return what of a trial's entry its own track contradicts; empty where nothing does."""
    swing = _swing(trial)
    if swing is None:
        return ""
    time, turns = swing
    duration, entered = float(time[-1] - time[0]), trial.frequency_hz
    highest = min(ENTRY.frequencies_hz[1], 0.25 / float(np.median(np.diff(time))))
    # steps of a quarter of what the duration resolves: no peak falls between them
    tried = np.arange(ENTRY.frequencies_hz[0], max(highest, 2 * entered), 0.25 / duration)
    power = np.array([_power(time, turns, f)[0] for f in tried])
    best = float(tried[int(np.argmax(power))])
    own, waves = _power(time, turns, entered)
    if (
        abs(best - entered) > max(ENTRY.most_off_share * entered, ENTRY.resolution / duration)
        and own < ENTRY.least_power_share * power.max()
    ):
        return f"the body swings at {best:.2g} Hz, not at the {entered:.3g} Hz that are entered"
    # joint i + 1 less joint i: beta_{i+1} - beta_i of (13)
    lags = np.angle(waves[1:] * np.conj(waves[:-1]))
    mean = np.angle(np.exp(1j * lags).sum())
    even = np.abs(np.angle(np.exp(1j * (lags - mean)))).max() < ENTRY.even_rad
    off = abs(np.angle(np.exp(1j * (mean - trial.phase_lag_rad))))
    if even and off > ENTRY.most_off_phase_rad:
        entered_rad = trial.phase_lag_rad
        return (
            f"segments follow each other by {mean:+.2f} rad, not by the {entered_rad:+.2f} that are entered"
        )
    return ""


def _swing(trial: Trial) -> tuple[np.ndarray, np.ndarray] | None:
    """Return times (n,) and the body's turns at its joints (n, J); None where they do not tell a gait."""
    markers = trial.markers_m
    plain = trial.kind == "gait" and trial.schedule is None and trial.applied is None and trial.spots is None
    if not plain or markers is None or markers.shape[1] < ENTRY.least_markers or trial.frequency_hz <= 0:
        return None
    whole = np.isfinite(markers).all(axis=(1, 2))
    time = trial.time_s[whole]
    if time.size < ENTRY.least_frames or (time[-1] - time[0]) * trial.frequency_hz < ENTRY.least_cycles:
        return None
    turns = turning_angles(markers[whole])
    part = np.linspace(-1, 1, time.size)
    trend = np.column_stack([np.ones_like(part), part])
    return time, turns - trend @ np.linalg.lstsq(trend, turns, rcond=None)[0]


def _power(time: np.ndarray, turns: np.ndarray, frequency_hz: float) -> tuple[float, np.ndarray]:
    """Return the swing's power at a frequency, all joints together, and every joint's complex amplitude."""
    waves = 2 / time.size * (np.exp(-2j * math.pi * frequency_hz * time) @ turns)
    return float(np.sum(np.abs(waves) ** 2)), waves

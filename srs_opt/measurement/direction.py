"""Which end of a chain of markers is the head: labels, else the phases of the bends, else where it goes."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from srs_opt.errors import InputError
from srs_opt.geometry import turning_angles
from srs_opt.measurement.chain import Chain
from srs_opt.measurement.records import Array
from srs_opt.measurement.take_settings import DIRECTION


def head_first(
    chain: Chain,
    ends: tuple[str, str],
    time_s: Array,
    tracks: Array,
    frequency_hz: float,
    lag_rad: float,
    head: str | None,
    warnings: list[str],
) -> bool:
    """Return whether the chain runs head to tail.

    The wave of valve states advances by the phase lag from segment to segment towards the head, so the
    bends' phases tell head and tail whatever the ground does with the robot. Conflicts become warnings.

    Raises
    ------
    InputError
        If `head` is at neither end.
    """
    phase = _by_phase(time_s, tracks, frequency_hz, lag_rad)
    travel = _by_travel(chain, tracks, lag_rad)
    known = None
    if head is not None:
        if head not in ends:
            raise InputError(
                f"head marker '{head[:40]}' is not at an end of the robot (ends: {', '.join(ends)})"
            )
        known = ends[0] == head
    elif "head" in ends[0].lower() or "tail" in ends[1].lower():
        known = True
    elif "head" in ends[1].lower() or "tail" in ends[0].lower():
        known = False
    if known is not None:
        if phase is not None and phase != known:
            warnings.append(
                "the bends run against the phase lag: is its sign right, and is the head's label at the head?"
            )
        return known
    if phase is not None:
        if travel is not None and travel != phase:
            warnings.append(
                "the phases of the bends and the direction of travel disagree about head and tail: the "
                "phases were followed; check the sign of phase_lag_rad, or give --head-marker"
            )
        return phase
    if travel is None:
        warnings.append("neither bends nor travel tell head and tail: check, or give --head-marker")
        return False
    return travel


def _by_phase(time_s: Array, tracks: Array, frequency_hz: float, lag_rad: float) -> bool | None:
    """Tell by the mean phase step of neighbouring bends; None where it cannot be told."""
    # a lag near 0 or pi looks alike from both ends
    if frequency_hz <= 0 or abs(math.sin(lag_rad)) < 0.1 or tracks.shape[1] < 4:
        return None
    waves = []
    for bend in turning_angles(tracks).T:
        seen = np.isfinite(bend)
        if not seen.any() or np.ptp(time_s[seen]) * frequency_hz < DIRECTION.least_cycles:
            return None
        wave = 2 * np.pi * frequency_hz * time_s[seen]
        basis = np.column_stack([np.sin(wave), np.cos(wave), np.ones_like(wave)])
        (a, b, mean), left = np.linalg.lstsq(basis, bend[seen], rcond=None)[:2]
        if left.size and left[0] > DIRECTION.most_left * float(((bend[seen] - mean) ** 2).sum()):
            return None  # not the frequency of these bends
        # a sin(wt) + b cos(wt): the argument is the phase
        waves.append(complex(a, b))
    steps = [w * np.conj(v) for v, w in pairwise(waves)]
    size = sum(abs(step) for step in steps)
    if size <= 0:
        return None
    mean = sum(steps).imag / size
    if abs(mean) < DIRECTION.least_lag * abs(math.sin(lag_rad)):
        return None
    # (13): beta grows by the lag from tail to head; a chain along which it falls is listed from the head
    return bool(mean * math.sin(lag_rad) < 0)


def _by_travel(chain: Chain, tracks: Array, lag_rad: float) -> bool | None:
    """Tell by where a wheeled robot goes; None where it hardly moves."""
    whole = tracks[np.isfinite(tracks[:, :, 0]).all(axis=1)]
    if len(whole) < 2:
        return None
    travel = whole[-1].mean(axis=0) - whole[0].mean(axis=0)
    axis = (whole[:, -1] - whole[:, 0]).mean(axis=0)
    along = float(travel @ axis) / max(float(np.linalg.norm(axis)), 1e-9)
    if abs(along) < chain.pitch_m:
        return None
    # with a positive lag the wave runs from head to tail and drives the robot head first
    return along * (-1.0 if lag_rad < 0 else 1.0) < 0

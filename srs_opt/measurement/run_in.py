"""How many cycles of its gait a robot had behind it when the recording began.

The bends are periodic within a settling time of the actuators, so they tell the valves' phase and no more.
The body is slower: its first cycles from rest carry it less far than those that follow. Their share of the
settled cycle's way hardly depends on friction, so the model's shares tell the recorded ones' number.
"""

from __future__ import annotations

import math

import numpy as np

from srs_opt.measurement.chain import chain_of, marker_positions
from srs_opt.measurement.records import Array
from srs_opt.measurement.spots import Spots
from srs_opt.measurement.take_settings import RUN_IN
from srs_opt.measurement.valve_wave import ValveWave
from srs_opt.robot import Robot
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.interpolate import linear


def run_in_s(frequency_hz: float) -> float:
    """Return the time of whole cycles after which the motion no longer depends on how it began."""
    cycles = max(RUN_IN.least_run_in_cycles, int(np.ceil(RUN_IN.least_s * frequency_hz)))
    return cycles / frequency_hz


def likely_start_s(
    robot: Robot,
    wave: ValveWave,
    time_s: Array,
    markers_m: Array,
    spots: Spots | None,
    noise_m: float,
    starts_s: Array,
) -> float:
    """Return the start of the valves that explains how the ways of the first cycles differ.

    Parameters
    ----------
    starts_s : ndarray, shape (K,)
        Candidates, none after the first frame; the first is kept unless another is clearly better.
    noise_m : float
        Standard deviation of a coordinate.
    """
    period, first = 1 / wave.frequency_hz, float(time_s[0])
    whole = min(int((time_s[-1] - first) / period), RUN_IN.seen_cycles)
    marks = np.asarray(first + period * np.arange(whole + 1), dtype=np.float64)
    seen, sd = _shares(time_s, markers_m.mean(axis=1), marks, noise_m / math.sqrt(markers_m.shape[1]))
    if seen is None:
        return float(starts_s[0])
    run, chain = Integrator(robot), chain_of(robot, spots)
    misfits = []
    for start in starts_s:
        played = run.integrate(wave.timeline(robot.segments, float(marks[-1] - start)), run.rest())
        pose, kappa = played.at(marks - start)
        points = marker_positions(chain, np.concatenate([pose, kappa], axis=1))
        expected, _ = _shares(marks, points.mean(axis=-2), marks, 0.0)
        if expected is None:
            misfits.append(math.inf)
            continue
        # the model itself is uncertain by how much the early cycles fall short
        spread = np.sqrt(sd**2 + (RUN_IN.model_share * (1 - expected)) ** 2)
        # -2 log likelihood with its normalization, because the candidates' spreads differ
        misfits.append(float(np.sum(((seen - expected) / spread) ** 2 + 2 * np.log(spread))))
    best = int(np.argmin(misfits))
    return float(starts_s[best if misfits[0] - misfits[best] > RUN_IN.evidence else 0])


def _shares(time_s: Array, middle_m: Array, marks_s: Array, sd_m: float) -> tuple[Array | None, float]:
    """Return every early cycle's way over the mean of the late ones', and the deviation of such a share.

    The middle is not a number where a marker is lost. The deviation is that of the markers' noise or of the
    late ways themselves, whichever is larger.
    """
    whole = np.isfinite(middle_m).all(axis=1)
    if len(marks_s) <= RUN_IN.least_cycles or whole.sum() < 2:
        return None, math.nan
    ways = np.linalg.norm(np.diff(linear(time_s[whole], middle_m[whole], marks_s), axis=0), axis=1)
    early, late = np.split(ways, [len(ways) // 2])
    mean = float(late.mean())
    if not mean > 10 * sd_m:  # it hardly moves on
        return None, math.nan
    return early / mean, max(math.sqrt(2) * sd_m / mean, float(late.std(ddof=1)) / mean, RUN_IN.least_sd)

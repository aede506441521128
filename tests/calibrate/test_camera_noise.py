"""What cameras and notebooks add, found without a model of the motion: made-up tracks of known noise."""

import math
from dataclasses import replace

import numpy as np
import pytest

from srs_opt.calibrate.clean import cleaned, outliers_of
from srs_opt.calibrate.colour import coloured
from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.entries import contradicted
from srs_opt.calibrate.experiment import Point
from srs_opt.calibrate.noise import Noise
from srs_opt.calibrate.normal_equations import NormalEquations
from srs_opt.calibrate.rejection import left_out
from srs_opt.calibrate.smooth_variance import Amplitudes, smooth_part
from srs_opt.measurement.records import DataSet, Trial
from srs_opt.robot import wpi_srs

RATE_HZ, SECONDS, LINKS, PITCH_M = 120.0, 4.0, 5, wpi_srs().pitch_m
TIME_S = np.arange(0, SECONDS, 1 / RATE_HZ)


def wave(frequency_hz=1.5, lag_rad=math.pi / 2, swing_rad=0.4):
    """Return markers (T, 5, 2) of a chain whose joints swing one after the other while it creeps ahead."""
    angle = np.zeros((TIME_S.size, LINKS - 1))
    for joint in range(1, LINKS - 1):
        phase = 2 * math.pi * frequency_hz * TIME_S + lag_rad * joint
        angle[:, joint] = angle[:, joint - 1] + swing_rad * np.sin(phase)
    steps = PITCH_M * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    points = np.concatenate([np.zeros((TIME_S.size, 1, 2)), np.cumsum(steps, axis=1)], axis=1)
    return points + 0.05 * TIME_S[:, None, None] * [1.0, 0.0]


def trial(points, name="t", **entry):
    known = {"frequency_hz": 1.5, "phase_lag_rad": math.pi / 2, **entry}
    values = {"pressure_kpa": 48.0, "offset": 0.0, "heading_rad": 0.0, "duration_s": SECONDS}
    return Trial(name, **known, **values, time_s=TIME_S, markers_m=points)


def walk(rng, sd_m, time_s, shape):
    """Return an Ornstein-Uhlenbeck process, (T, ...)."""
    keep = math.exp(-1 / (RATE_HZ * time_s))
    found = np.empty((TIME_S.size, *shape))
    found[0] = rng.standard_normal(shape)
    for k in range(1, TIME_S.size):
        found[k] = keep * found[k - 1] + math.sqrt(1 - keep**2) * rng.standard_normal(shape)
    return sd_m * found


@pytest.mark.parametrize("sd_m", [0.0, 0.0003])
def test_correlated_noise_is_found_though_the_model_is_wrong(sd_m):
    rng = np.random.default_rng(3)
    trials, residuals = [], []
    for k in range(9):
        noise = 0.001 * rng.standard_normal((TIME_S.size, LINKS, 2)) + walk(rng, sd_m, 0.2, (LINKS, 2))
        trials.append(trial(wave() + noise, str(k)))
        predicted = wave(swing_rad=0.36)  # centimetres off
        residuals.append((trials[-1].markers_m - predicted).reshape(TIME_S.size, -1))
    found = coloured(Noise(0.001), trials, residuals)
    assert found.correlated_sd_m == pytest.approx(sd_m, rel=0.2, abs=1e-9)
    if sd_m:
        assert 0.08 < found.correlation_s < 0.5
        assert coloured(found, trials, residuals) == found  # what is known stays


def test_outliers_are_left_out_and_a_fast_motion_is_not():
    rng = np.random.default_rng(5)
    points = wave(2.5) + 0.001 * rng.standard_normal((TIME_S.size, LINKS, 2))
    assert not outliers_of(points, TIME_S).any()
    where = rng.random(points.shape[:2]) < 0.01
    spoiled = points + np.where(where[..., None], [0.012, -0.006], 0.0)
    found = outliers_of(spoiled, TIME_S)
    inside = np.s_[3:-3]  # the ends have neighbours on one side only
    assert np.mean(found[inside][where[inside]]) > 0.95
    assert np.sum(found & ~where) <= 1


def test_exchanged_labels_are_put_right():
    points = wave() + 0.001 * np.random.default_rng(2).standard_normal((TIME_S.size, LINKS, 2))
    swapped = points.copy()
    swapped[100:120, [1, 2]] = swapped[100:120, [2, 1]]
    found = cleaned(DataSet("", wpi_srs(), RATE_HZ, 0.001, trials=(trial(swapped),)))
    assert found.swapped == {"t": 20}
    assert np.allclose(found.dataset.trials[0].markers_m, points)


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({}, ""),
        ({"frequency_hz": 0.75}, "swings at 1.5 Hz"),
        ({"frequency_hz": 3.0}, "swings at 1.5 Hz"),
        ({"phase_lag_rad": -math.pi / 2}, "segments follow each other"),
    ],
)
def test_a_wrong_entry_is_seen_in_the_track(entry, words):
    found = contradicted(trial(wave() + 0.001, **entry))
    assert words in found and bool(found) == bool(words)


def test_a_set_that_is_counted_from_the_head_is_not_left_out():
    wrong = [trial(wave(), str(k), phase_lag_rad=-math.pi / 2) for k in range(6)]
    assert left_out(wrong) == {}
    assert list(left_out([*(replace(t, phase_lag_rad=math.pi / 2) for t in wrong[:5]), wrong[5]])) == ["5"]


@pytest.mark.parametrize(
    ("amplitude", "gap"), [(0.0, 0.0), (0.0, 3.0), (2e-3, 0.0), (2e-3, 3.0), (2e-2, 0.0)]
)
def test_smooth_errors_are_believed_when_small_and_never_hide_an_effect(amplitude, gap):
    rng = np.random.default_rng(11)
    equations, none = {}, np.zeros(0)
    for k in range(10):
        columns = rng.standard_normal((400, 7))  # one effect, four waves of the trial's own, two of drift
        own = amplitude / 1e-3 * rng.standard_normal(4)
        residual = gap * columns[:, 0] / 20 + columns[:, 1:5] @ own + rng.standard_normal(400)
        both = np.column_stack([columns, residual])
        equations[str(k)] = NormalEquations(both.T @ both, 400, (), none, none)
    units = Amplitudes({5: 1e3, 6: 1e3}, dict.fromkeys(range(1, 5), 1e4))
    effect = (Coordinate("e.size", "e"),)
    found = smooth_part(
        Noise(0.001), equations, dict.fromkeys(equations, units), effect, Point({"e.size": 0.0})
    )
    assert found.drift_m == 0
    assert (found.systematic_m > 0) == (amplitude == 2e-3)  # ten times as much is a discovery

"""Noise of the camera: the white part from the tracks, the correlated part as the data set states it."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from srs_opt.calibrate.noise import Noise, noise_of
from srs_opt.calibrate.normal_equations import trial_normal_equations
from srs_opt.calibrate.whiten import Whitening
from srs_opt.errors import InputError
from srs_opt.measurement.dataset import load_dataset, write_dataset
from srs_opt.measurement.records import DataSet, MapRow, Trial
from srs_opt.robot import wpi_srs

CAMERA = {"rate_hz": 100.0, "marker_sd_m": 0.001}


TIME_S = np.cumsum(np.random.default_rng(4).uniform(0.005, 0.02, 40))


def gappy(seed=0, coordinates=3):
    """Return values (T, C) with holes of their own in every coordinate."""
    rng = np.random.default_rng(seed)
    values = rng.standard_normal((TIME_S.size, coordinates))
    values[rng.random(values.shape) < 0.3] = np.nan
    return values


def covariance_of(noise, seen):
    """Return the covariance of the values that were seen, in the order of their rows."""
    frame, channel = np.nonzero(seen)
    same = channel[:, None] == channel
    lag = np.abs(TIME_S[frame][:, None] - TIME_S[frame])
    walk = noise.correlated_sd_m**2 * np.exp(-lag / noise.correlation_s) * same
    return walk + noise.white_sd_m**2 * np.eye(frame.size)


def test_whitening_is_what_the_covariance_says_whatever_frames_are_missing():
    noise, values = Noise(0.7, 0.4, 0.05), gappy()
    seen = np.isfinite(values)
    columns = np.column_stack(
        [np.nan_to_num(values).ravel(), np.random.default_rng(1).random((values.size, 4))]
    )
    whiten = Whitening(noise, TIME_S, seen)
    weight = np.linalg.inv(covariance_of(noise, seen))
    kept = columns[seen.ravel()]
    white = whiten(columns)
    assert white.T @ white == pytest.approx(kept.T @ weight @ kept, rel=1e-9)
    assert whiten.log_det == pytest.approx(-np.linalg.slogdet(weight)[1], rel=1e-9)
    assert np.array_equal(np.isfinite(whiten.in_place(white[:, 0])), seen)


def test_what_is_a_trials_own_is_integrated_out():
    noise, values = Noise(0.7, 0.4, 0.05), gappy()
    seen, rng = np.isfinite(values), np.random.default_rng(2)
    jacobian, own, own_sd = rng.random((values.size, 3)), rng.random((values.size, 2)), np.array([0.5, 2.0])
    whiten, none = Whitening(noise, TIME_S, seen), np.zeros(0)
    normal = trial_normal_equations(values.ravel(), jacobian, whiten, (), none, none, own, own_sd)
    rows = seen.ravel()
    part = own[rows] * own_sd
    weight = np.linalg.inv(covariance_of(noise, seen) + part @ part.T)
    both = np.column_stack([jacobian, values.ravel()])[rows]
    assert normal.raw == pytest.approx(both.T @ weight @ both, rel=1e-8)
    assert normal.count == rows.sum()


def test_white_noise_is_found_below_a_motion():
    dataset = recorded(np.random.default_rng(5), sd=0.001)
    assert noise_of(dataset).white_sd_m == pytest.approx(0.001, rel=0.05)
    known = replace(dataset, correlated_sd_m=0.0004, correlation_s=0.2)
    assert noise_of(known) == replace(noise_of(dataset), correlated_sd_m=0.0004, correlation_s=0.2)


def recorded(rng, sd):
    """Return a set with one trial of a marker on a circle."""
    time = np.arange(2000) / 100
    track = 0.1 * np.column_stack([np.cos(9 * time), np.sin(9 * time)]) + sd * rng.standard_normal((2000, 2))
    trial = Trial("t", 1.0, 48.0, 0.0, 1.57, 0.0, 20.0, time, centre_m=track)
    return DataSet("", wpi_srs(), 100.0, 0.003, trials=(trial,))


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"correlated_sd_m": 0.0004}, "correlation_s: missing"),
        ({"correlated_sd_m": -1.0, "correlation_s": 0.2}, "correlated_sd_m: expected a number"),
        ({"colour": 1}, "unknown key 'colour'"),
    ],
)
def test_bad_camera_keys_are_told(tmp_path, more, words):
    (tmp_path / "robot.yaml").write_text("{}\n")
    columns = "frequency_hz,pressure_kpa,offset,phase_lag_rad,speed_m_s,speed_sd_m_s,radius_m,radius_sd_m"
    (tmp_path / "maps.csv").write_text(f"{columns},replicates\n1,48,0,1.57,0.2,0.01,,,1\n")
    record = {"name": "x", "robot": "robot.yaml", "camera": {**CAMERA, **more}}
    (tmp_path / "dataset.yaml").write_text(yaml.safe_dump(record))
    with pytest.raises(InputError, match=words):
        load_dataset(tmp_path)


def test_correlated_noise_survives_the_round_trip(tmp_path):
    rows = (MapRow(1.0, 48.0, 0.0, 1.57, 0.2, 0.01, None, None, 1),)
    dataset = DataSet("x", wpi_srs(), 100.0, 0.001, maps=rows, correlated_sd_m=0.0004, correlation_s=0.2)
    again = load_dataset(write_dataset(dataset, tmp_path / "x"))
    assert (again.correlated_sd_m, again.correlation_s) == (0.0004, 0.2)

"""Noise of the camera: the white part from the tracks, the correlated part as the data set states it."""

import math
from dataclasses import replace

import numpy as np
import pytest
import yaml

from srs_opt.calibrate.noise import noise_sd_m
from srs_opt.errors import InputError
from srs_opt.measurement.dataset import load_dataset, write_dataset
from srs_opt.measurement.records import DataSet, MapRow
from srs_opt.robot import wpi_srs

CAMERA = {"rate_hz": 100.0, "marker_sd_m": 0.001}


def test_correlated_noise_counts_as_it_moves_a_mean():
    # of n independent coordinates' means over T, correlated noise against white noise of the assumed size
    sd, tau, rate, samples, runs = 0.0004, 0.2, 100.0, 3000, 2000
    rng = np.random.default_rng(1)
    keep = math.exp(-1 / (rate * tau))
    walk, total = sd * rng.standard_normal(runs), np.zeros(runs)
    for _ in range(samples):
        walk = keep * walk + sd * math.sqrt(1 - keep**2) * rng.standard_normal(runs)
        total += walk
    dataset = DataSet("", wpi_srs(), rate, 1e-12, correlated_sd_m=sd, correlation_s=tau)
    assert noise_sd_m(dataset) / math.sqrt(samples) == pytest.approx(np.std(total / samples), rel=0.06)
    both = replace(dataset, marker_sd_m=0.003)
    assert noise_sd_m(both) == pytest.approx(math.hypot(0.003, noise_sd_m(dataset)), rel=1e-9)


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

"""The drive's inverse finds what was asked for; its calibration recovers planted factors."""

import json
import math

import numpy as np
import pytest

from srs_opt.drive.__main__ import main
from srs_opt.drive.calibration import DriveCalibration, Factor, fit_factor, load_calibration, save_calibration
from srs_opt.drive.drive import Drive, drive_from_map
from srs_opt.drive.fit import calibrate_drive, load_measured_map
from srs_opt.errors import InputError, OutOfReachError
from srs_opt.gait import Wave
from srs_opt.gait_map.grid import GaitMap, grid_points, map_at, save_map
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs


@pytest.fixture(scope="module")
def simulated() -> GaitMap:
    points = grid_points([1.0, 1.5, 2.0], [41.0, 55.0], [0.0, 0.25, 0.5, 0.75], [0.9, math.pi / 2])
    return map_at(wpi_srs(), "complex", points, jobs=2)


@pytest.fixture(scope="module")
def drive(simulated) -> Drive:
    return drive_from_map(wpi_srs(), simulated)


@pytest.mark.parametrize("speed", [0.15, 0.3, -0.3])
@pytest.mark.parametrize("turn", [0.0, 0.6, -0.6])
def test_inverse_then_simulation_gives_the_wanted_motion(drive, speed, turn):
    chosen = drive.gait_for(speed, turn)
    orbit = steady_gait(wpi_srs(), chosen.gait)
    assert orbit.speed_m_s == pytest.approx(speed, rel=0.03)
    assert orbit.turn_rate_rad_s == pytest.approx(turn, abs=0.03)
    assert chosen.reverse == (speed < 0)


def test_radius_is_signed(drive):
    left, right = drive.gait_for_radius(0.2, 0.4), drive.gait_for_radius(0.2, -0.4)
    assert left.orbit.radius_m == pytest.approx(0.4, rel=0.03)
    assert right.orbit.radius_m == pytest.approx(-0.4, rel=0.03)


def test_outside_is_refused_with_the_nearest_motion(drive):
    with pytest.raises(OutOfReachError, match="nearest reachable"):
        drive.gait_for(0.9, 0.0)
    speed, turn = drive.nearest_reachable(0.9, 0.0)
    assert 0.5 < speed < 0.6
    assert abs(turn) < 0.5
    drive.gait_for(0.99 * speed, 0.99 * turn)


def test_planted_factors_are_recovered(simulated, tmp_path):
    rng = np.random.default_rng(3)
    rows = simulated.rows[np.isfinite(simulated.column("radius_m"))][::2]
    n = len(rows)
    speed = rows[:, 4] * 0.9 * np.exp(0.02 * rng.standard_normal(n))
    radius = rows[:, 6] * 1.3 * np.exp(0.02 * rng.standard_normal(n))
    file = tmp_path / "maps.csv"
    header = "frequency_hz,pressure_kpa,offset,phase_lag_rad,"
    header += "speed_m_s,speed_sd_m_s,radius_m,radius_sd_m,replicates"
    table = np.column_stack([rows[:, :4], speed, 0.01 * speed, radius, 0.01 * radius, np.full(n, 3)])
    np.savetxt(file, table, delimiter=",", header=header, comments="")
    calibration = calibrate_drive(wpi_srs(), load_measured_map(file))
    assert calibration.speed.value == pytest.approx(0.9, abs=4 * calibration.speed.sd)
    assert calibration.radius.value == pytest.approx(1.3, abs=4 * calibration.radius.sd)
    assert 0.005 < calibration.speed.scatter_sd < 0.04  # planted: 2 % beyond the stated 1 %
    again = load_calibration(save_calibration(calibration, tmp_path / "drive.json"))
    assert again == calibration


def test_calibrated_drive_answers_in_measured_units(simulated):
    calibration = DriveCalibration(Factor(0.8, 0.01, 0.02, 9), Factor(1.25, 0.01, 0.03, 9))
    corrected = drive_from_map(wpi_srs(), simulated, calibration)
    chosen = corrected.gait_for(0.16, 0.3)
    assert chosen.speed_m_s == pytest.approx(0.16, rel=0.03)
    assert chosen.orbit.speed_m_s == pytest.approx(0.2, rel=0.03)
    assert chosen.turn_rate_sd_rad_s > chosen.turn_rate_rad_s * 0.03


def test_displacement_follows_the_factors():
    """Chained cycles of the corrected displacement run on a circle of the corrected radius."""
    orbit = steady_gait(wpi_srs(), Wave.uniform(4, 2.0, 55.0, math.pi / 2, 0.4).gait())
    calibration = DriveCalibration(Factor(0.9), Factor(1.3))
    dx, dy, turn = calibration.displacement(orbit.motion.displacement)
    simulated = math.hypot(*orbit.motion.displacement[:2]) / (2 * math.sin(orbit.motion.displacement[2] / 2))
    assert math.hypot(dx, dy) / (2 * math.sin(turn / 2)) == pytest.approx(1.3 * simulated, rel=1e-9)
    assert turn == pytest.approx(orbit.motion.displacement[2] * 0.9 / 1.3)
    straight = calibration.displacement(np.array([0.1, 0.0, 0.0]))
    assert straight == pytest.approx([0.09, 0, 0])


def test_factor_interval_covers_the_truth():
    """The stated standard deviation of the factor is honest: z-scores over many sets have unit spread."""
    rng = np.random.default_rng(1)
    scores = []
    for _ in range(400):
        simulated = rng.uniform(0.1, 0.5, 12)
        truth = 1.1 * simulated * np.exp(0.05 * rng.standard_normal(12))
        measured = truth * (1 + 0.02 * rng.standard_normal(12))
        factor = fit_factor(simulated, measured, 0.02 * measured)
        scores.append((math.log(factor.value) - math.log(1.1)) / (factor.sd / factor.value))
    assert 0.85 < np.std(scores) < 1.25


def test_command(simulated, tmp_path, capsys):
    file = save_map(simulated, tmp_path / "map.csv")
    arguments = ["--map", str(file), "--out", str(tmp_path / "out"), "--json"]
    assert main(["--speed", "0.2", "--radius", "0.4", *arguments]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["radius_m"] == pytest.approx(0.4, rel=0.03)
    assert len(record["switches"]) == 4
    assert main(["--speed", "2", *arguments]) == 1
    output = capsys.readouterr()
    assert "nearest reachable" in json.loads(output.out)["error"]
    assert main(["--speed", "0.2", "--radius", "0", *arguments]) == 2


def test_map_without_a_grid_is_refused(simulated):
    with pytest.raises(InputError, match="two frequencies"):
        drive_from_map(wpi_srs(), GaitMap(simulated.rows[:1]))

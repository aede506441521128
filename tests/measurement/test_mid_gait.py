"""Recordings that begin in mid-gait, and frequencies that are nominal, against the virtual laboratory."""

import numpy as np
import pytest
from measure_fixtures import ROBOT

from srs_opt.calibrate.alignment import align
from srs_opt.calibrate.candidates import fitted_coordinates
from srs_opt.calibrate.experiment import Experiment
from srs_opt.calibrate.fit import start_point
from srs_opt.calibrate.model import Model
from srs_opt.measurement.dataset import load_dataset, write_dataset
from srs_opt.measurement.frequency import far_frequency, seen_frequency
from srs_opt.measurement.importing import ImportOptions, import_takes, read_trial_list
from srs_opt.measurement.onset import find_onset
from srs_opt.measurement.run_in import run_in_s
from srs_opt.measurement.takes.take import Take
from srs_opt.measurement.valve_wave import ValveWave
from virtual_lab.simulate import run
from virtual_lab.trials import Trial as LabTrial
from virtual_lab.truth import Truth

SD = 1e-3
RATE = 120.0


@pytest.fixture(scope="module")
def lab():
    """Eight seconds of a turning gait at 1.514 Hz, noise of 1 mm."""
    time = np.arange(round(8 * RATE)) / RATE
    seen = run(Truth(), LabTrial("a", 1.514, 48.0, 0.2, np.pi / 2, 0.3, 8.0), time)
    points = np.stack([seen.x, seen.y], axis=-1)
    return time, points + SD * np.random.default_rng(5).normal(size=points.shape)


def imported(tmp_path, time, points, columns=("1.5", "48", "0.2", "1.5707963")):
    """Import the tracks, turned and moved, as a take whose clock begins at 7 s."""
    turn = np.exp(0.9j)
    z = (points[..., 0] + 1j * points[..., 1]) * turn + 0.3
    take = Take(
        source=tmp_path / "a.csv",
        name="a",
        rate_hz=RATE,
        time_s=7.0 + time - time[0],
        markers=tuple("edcba"),
        marker_positions=np.stack([z.real, z.imag, 0 * z.real], axis=-1)[:, ::-1],
        flat=True,
    )
    (tmp_path / "list.csv").write_text(
        "trial,frequency_hz,pressure_kpa,offset,phase_lag_rad\na," + ",".join(columns) + "\n"
    )
    rows = read_trial_list(tmp_path / "list.csv")
    return import_takes([take], rows, ROBOT, "s", ImportOptions())


def misfit(trial):
    base = fitted_coordinates(ROBOT)
    experiment = Experiment(Model(ROBOT, "complex"), [trial], SD)
    normal = experiment.normal_equations(start_point(base), base)["a"]
    return normal.misfit / normal.count, normal


def test_a_take_that_begins_in_mid_gait_is_explained_to_the_noise(tmp_path, lab):
    time, points = lab
    late = time >= 3.3
    data, notes = imported(tmp_path, time[late], points[late])
    trial = data.trials[0]
    assert trial.moving
    assert trial.frequency_hz == pytest.approx(1.514, abs=0.002)  # 0.7 % off when listed
    assert any("taken as seen" in w for w in notes[0].warnings)
    ratio, normal = misfit(trial)
    # 4.7 s of 1 mm markers: 1 +- 0.02 for the true robot
    assert 0.94 < ratio < 1.06
    # pose and clock are no part of what the coordinates are blamed for
    assert np.isfinite(normal.raw).all()


@pytest.mark.parametrize("cut_s", [0.02, 0.1, 0.3, 0.5])
def test_a_camera_that_starts_a_moment_after_the_valves(lab, cut_s):
    """The bends tell the phase, the body's slower first cycle that it is the first."""
    time, points = lab
    late = time >= cut_s
    # bench values that are off do not change the answer
    off = ROBOT.with_values(
        friction_tangential=1.3 * ROBOT.friction_tangential,
        friction_normal=0.8 * ROBOT.friction_normal,
        curvature_per_pressure_1_m_kpa=1.1 * ROBOT.curvature_per_pressure_1_m_kpa,
    )
    found = find_onset(off, ValveWave(1.514, 48.0, 0.2, np.pi / 2), time[late], points[late])
    assert found.moving and not found.doubt
    assert abs(found.time_s) < 0.003


def test_a_run_in_that_left_no_trace_is_whole_cycles(lab):
    time, points = lab
    late = time >= 4.0
    found = find_onset(ROBOT, ValveWave(1.514, 48.0, 0.2, np.pi / 2), time[late], points[late])
    before = 4.0 - found.time_s
    assert run_in_s(1.514) - 0.01 < before < run_in_s(1.514) + 1 / 1.514
    assert found.time_s * 1.514 == pytest.approx(round(found.time_s * 1.514), abs=0.01)


def test_the_data_set_keeps_what_begins_in_motion(tmp_path, lab):
    time, points = lab
    data, _ = imported(tmp_path, time[400:], points[400:])
    again = load_dataset(write_dataset(data, tmp_path / "set"))
    assert again.trials[0].moving
    assert again.trials[0].time_s[0] == pytest.approx(data.trials[0].time_s[0], abs=1e-6)


def test_frequency_is_seen_to_its_deviation(lab):
    time, points = lab
    found = seen_frequency(time[120:], points[120:], 1.5)
    assert abs(found.value_hz - 1.514) < 4 * found.sd_hz < 0.01
    assert found.differs(1.5, 8.0) and not found.differs(1.514, 8.0)
    assert seen_frequency(time, points, 2.0) is None
    assert far_frequency(time, points, 2.0) == pytest.approx(1.514, abs=0.05)
    assert far_frequency(time, points, 1.5) is None


def test_alignment_recovers_turn_shift_and_clock():
    time = np.arange(300) / 100

    def motion(later):
        t = time + later
        return np.column_stack([0.2 * t, 0.01 * np.sin(9 * t), 0.2 * t + 0.1, 0.01 * np.cos(9 * t)])

    z = motion(0.013).reshape(300, 2, 2) @ np.array([1, 1j]) * np.exp(2.1j) + (0.4 - 1j)
    track = np.stack([z.real, z.imag], axis=-1).reshape(300, 4)
    track[10:20, :2] = np.nan
    found, _free = align(track, motion, 0.3)
    assert found.later_s == pytest.approx(0.013, abs=1e-6)
    assert found.turn_rad == pytest.approx(2.1, abs=1e-6)
    assert np.nanmax(np.abs(found.points(motion(found.later_s)) - track)) < 1e-6

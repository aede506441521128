"""The layout is read as documented and written back unchanged."""

import numpy as np
import pytest
from measure_fixtures import add_bench, write_set

from srs_opt.errors import InputError
from srs_opt.measurement.dataset import load_dataset, write_dataset
from srs_opt.measurement.validate import problems


def test_a_sound_set_has_no_problems(tmp_path):
    folder = write_set(tmp_path / "set")
    add_bench(folder)
    assert problems(folder) == []
    found = load_dataset(folder)
    assert (found.name, found.rate_hz, found.marker_sd_m, found.markers) == (
        "small",
        120,
        0.001,
        "tail_to_head",
    )
    assert [t.name for t in found.trials] == ["t1", "t2"]
    trial = found.trial("t2")
    assert trial.markers_m.shape == (240, 5, 2)
    assert (trial.frequency_hz, trial.pressure_kpa, trial.duration_s) == (2, 48, 2)
    assert trial.tether
    assert trial.kind == "gait"
    assert trial.schedule is None
    assert found.robot.relative_sd == {"friction_tangential": 0.05}
    assert len(found.bench.spring_car) == 2
    assert len(found.bench.steps) == 1
    assert [t.with_tether for t in found.bench.tow] == [True, True, False, False]


def test_written_and_read_again_is_the_same(tmp_path):
    folder = write_set(tmp_path / "set")
    add_bench(folder)
    (folder / "maps.csv").write_text(
        "frequency_hz,pressure_kpa,offset,phase_lag_rad,speed_m_s,speed_sd_m_s,radius_m,radius_sd_m,replicates\n"
        "1,41,0,1.5708,0.08,0.002,,,3\n1,41,-0.4,1.5708,0.07,0.002,-0.25,0.01,3\n"
    )
    (folder / "schedules").mkdir()
    (folder / "schedules" / "free.csv").write_text(
        "segment,on_s,off_s,period_s\n1,0.1,0.3,0.5\n2,0.4,0.1,0.5\n3,0,0.2,0.5\n4,0,0.5,0.5\n"
    )
    text = (folder / "trials.csv").read_text().splitlines()
    extra = [
        ",schedule,tether,floor,replicate_of,kind",
        ",free,no,felt,,gait",
        ",schedules/free.csv,yes,,t1,gait",
    ]
    (folder / "trials.csv").write_text("\n".join(a + b for a, b in zip(text, extra)) + "\n")
    assert [p for p in problems(folder) if p.severity == "error"] == []
    first = load_dataset(folder)
    again = load_dataset(write_dataset(first, tmp_path / "copy"))
    assert again.maps == first.maps
    assert first.maps[0].radius_m is None
    assert again.bench.tow == first.bench.tow
    assert again.bench.spring_car == first.bench.spring_car
    assert again.bench.checks == first.bench.checks
    for a, b in zip(first.trials, again.trials):
        assert np.array_equal(a.markers_m, b.markers_m, equal_nan=True)
        assert (a.schedule, a.tether, a.floor, a.replicate_of) == (
            b.schedule,
            b.tether,
            b.floor,
            b.replicate_of,
        )
    schedule = first.trials[0].schedule
    states = schedule.state(2, np.array([0.05, 0.2, 0.45, 0.95, 1.05]))
    assert states.tolist() == [1, -1, 1, 1, 1]


def test_centre_of_mass_tracks(tmp_path):
    trial = load_dataset(write_set(tmp_path / "set", markers="centre_of_mass")).trials[0]
    assert trial.markers_m is None
    assert trial.centre_m.shape == (240, 2)


def test_maps_alone_are_a_data_set(tmp_path):
    folder = write_set(tmp_path / "set")
    (folder / "trials.csv").unlink()
    (folder / "maps.csv").write_text(
        "frequency_hz,pressure_kpa,offset,phase_lag_rad,speed_m_s,speed_sd_m_s,radius_m,radius_sd_m,replicates\n"
        "1,41,0,1.5708,0.08,0.002,,,3\n"
    )
    found = load_dataset(folder)
    assert len(found.maps) == 1
    assert found.trials == ()


def test_empty_cells_are_lost_markers(tmp_path):
    folder = write_set(tmp_path / "set")
    path = folder / "trials" / "t1.csv"
    lines = path.read_text().splitlines()
    cells = lines[5].split(",")
    lines[5] = ",".join([*cells[:3], "", "", *cells[5:]])
    path.write_text("\n".join(lines) + "\n")
    markers = load_dataset(folder).trials[0].markers_m
    assert np.isnan(markers[4, 1]).all()
    assert np.isfinite(markers).sum() == markers.size - 2


def test_half_the_markers_lost_is_a_warning(tmp_path):
    from measure_fixtures import gait_track, track_text

    folder = write_set(tmp_path / "set")
    time, points = gait_track()
    points[np.random.default_rng(0).random(points.shape[:2]) < 0.5] = np.nan
    (folder / "trials" / "t1.csv").write_text(track_text(time, points))
    found = problems(folder)
    assert {p.severity for p in found} == {"warning"}
    assert any("marker positions are lost" in p.message for p in found)
    assert 0.4 < load_dataset(folder).trials[0].lost_fraction < 0.6


def test_missing_folder(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        load_dataset(tmp_path / "nowhere")


@pytest.mark.parametrize("markers", ["tail_to_head", "centre_of_mass"])
def test_a_generated_set_is_read(tmp_path, markers):
    import subprocess
    import sys

    out = tmp_path / "lab"
    command = [
        sys.executable,
        "-m",
        "virtual_lab",
        "--design",
        "steps",
        "--bench",
        "--quiet",
        "--out",
        str(out),
    ]
    command += ["--centre-of-mass"] if markers == "centre_of_mass" else []
    subprocess.run(command, check=True, cwd=str(__import__("pathlib").Path(__file__).parents[2]))
    assert [p for p in problems(out) if p.severity == "error"] == []
    found = load_dataset(out)
    assert found.markers == markers
    assert found.bench.steps
    assert found.bench.checks

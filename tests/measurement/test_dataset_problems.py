"""Everything wrong with a folder is said at once, with file and line."""

import numpy as np
import pytest
from measure_fixtures import HEADER, add_bench, gait_track, track_text, write_set

from srs_opt.errors import InputError
from srs_opt.measurement.dataset import load_dataset
from srs_opt.measurement.validate import problems


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def found(folder, severity="error"):
    return [str(p) for p in problems(folder) if p.severity == severity]


@pytest.fixture
def folder(tmp_path):
    made = write_set(tmp_path / "set")
    add_bench(made)
    return made


def write_track(folder, time, points):
    (folder / "trials" / "t1.csv").write_text(track_text(time, points))


def test_all_at_once(folder):
    edit(folder / "dataset.yaml", "rate_hz: 120", "rate_hz: fast")
    edit(folder / "trials.csv", "t1,2,48", "t1,two,48")
    (folder / "trials" / "t2.csv").unlink()
    edit(folder / "bench" / "tow.csv", "0.06,yes", "0.06,maybe")
    listed = found(folder)
    for words in (
        "dataset.yaml:4: camera.rate_hz",
        "trials.csv:2: frequency_hz",
        "trials.csv:3",
        "tow.csv:2",
    ):
        assert any(words in line for line in listed), (words, listed)
    with pytest.raises(InputError, match=r"and \d+ more"):
        load_dataset(folder)


def test_everything_in_the_robot_file(folder):
    (folder / "robot.yaml").write_text(
        "lenght: 1\nsegment_length_m: 37\ntau1_s: soon\ngap_length_m: .inf\n"
        "relative_sd: {tau3_s: 0.1, tau1_s: -1}\nsources: {tau1_s: guessed}\n"
        "effects:\n  - {name: tether_drga, force_n: 1}\n  - {name: tether_drag}\n  - {force_n: 1}\n"
    )
    listed = [line for line in found(folder) if line.startswith("robot.yaml")]
    for line, words in (
        (1, "unknown key 'lenght'"),
        (2, "segment_length_m: must be at most 2 (in millimetres?), found 37"),
        (3, "tau1_s: expected a number"),
        (4, "gap_length_m: must be a finite number"),
        (5, "relative_sd.tau3_s: is not a parameter"),
        (5, "relative_sd.tau1_s: must be at least 0"),
        (6, "sources.tau1_s: must be one of"),
        (8, "did you mean 'tether_drag'"),
        (9, "needs 'force_n'"),
        (10, "'name' is missing"),
    ):
        assert any(text.startswith(f"robot.yaml:{line}: ") and words in text for text in listed), (
            words,
            listed,
        )
    assert len(listed) == 10


def test_clock_that_jumps(folder):
    time, points = gait_track()
    time[100:] += 0.5
    write_track(folder, time, points)
    assert any("t1.csv:102" in line and "jumps" in line for line in found(folder))


def test_clock_that_goes_backwards(folder):
    time, points = gait_track()
    time[100:] -= 0.3
    write_track(folder, time, points)
    assert any("t1.csv:102" in line and "backwards" in line for line in found(folder))


def test_a_few_missing_frames_are_a_warning(folder):
    time, points = gait_track()
    keep = np.r_[0:50, 53:240]
    write_track(folder, time[keep], points[keep])
    assert found(folder) == []
    assert any("3 frame(s) are missing" in line for line in found(folder, "warning"))


def test_trial_of_nan(folder):
    time, points = gait_track()
    write_track(folder, time, np.full_like(points, np.nan))
    assert any("t1.csv" in line and "no measurement" in line for line in found(folder, "warning"))
    assert found(folder) == []


UNITS = [
    ("millimetres", lambda t, p: (t, p * 1000)),
    ("kilometres", lambda t, p: (t, p / 1000)),
    ("milliseconds", lambda t, p: (t * 1000, p)),
    ("microseconds", lambda t, p: (t * 1e6, p)),
    ("centimetres", lambda t, p: (t, p * 100)),
    ("inches", lambda t, p: (t, p / 0.0254)),
]


@pytest.mark.parametrize(("word", "change"), UNITS)
def test_wrong_units_of_tracks(folder, word, change):
    write_track(folder, *change(*gait_track()))
    assert any("t1.csv" in line and word in line for line in found(folder)), found(folder)


CELLS = [
    ("trials.csv", "t1,2,48,", "t1,2,48000,", "pascals"),
    ("trials.csv", "t1,2,48,", "t1,2,0.048,", "megapascals"),
    ("trials.csv", "t1,2,48,", "t1,2000,48,", "millihertz"),
    ("trials.csv", "t1,2,48,", "t1,0.002,48,", "kilohertz"),
    ("trials.csv", "1.570796,0,2.0", "1.570796,0,2000", "milliseconds"),
    ("trials.csv", "0,1.570796,0", "0,90,0", "degrees"),
    ("dataset.yaml", "0.001", "1.0", "marker_sd_m"),
    ("robot.yaml", "links: 5", "links: 5\nlink_mass_kg: 30", "grams"),
    ("robot.yaml", "links: 5", "links: 5\nsegment_length_m: 37", "segment_length_m"),
    ("bench/spring_car.csv", "0.0084", "8.4", "millimetres"),
    ("bench/spring_car.csv", "0.1,0.0112", "100,0.0112", "grams"),
    ("bench/tow.csv", "0.1,0.06", "100,0.06", "mm/s"),
    ("bench/tow.csv", "0.1,0.06", "0.1,60", "millinewtons"),
]


@pytest.mark.parametrize(("file", "old", "new", "word"), CELLS)
def test_wrong_units_of_cells(folder, file, old, new, word):
    edit(folder / file, old, new)
    assert any(word in line for line in found(folder)), found(folder)


def test_wrong_units_of_steps(folder):
    path = folder / "bench" / "steps.csv"
    lines = [line.split(",") for line in path.read_text().splitlines()]
    for scale_time, scale_curvature, word in ((1000, 1, "milliseconds"), (1, 1e-3, "1/mm")):
        rows = [
            [*c[:4], str(float(c[4]) * scale_time), str(float(c[5]) * scale_curvature)] for c in lines[1:]
        ]
        path.write_text("\n".join(",".join(c) for c in [lines[0], *rows]) + "\n")
        assert any("steps.csv" in line and word in line for line in found(folder))


def test_wrong_units_of_maps(folder):
    head = "frequency_hz,pressure_kpa,offset,phase_lag_rad,"
    head += "speed_m_s,speed_sd_m_s,radius_m,radius_sd_m,replicates\n"
    for row, word in (
        ("1,41,0.4,1.57,80,2,0.25,0.01,3", "mm/s"),
        ("1,41,0.4,1.57,0.08,0.002,250,10,3", "mm"),
    ):
        (folder / "maps.csv").write_text(head + row + "\n")
        assert any("maps.csv" in line and word in line for line in found(folder))


def test_centre_of_mass_in_millimetres(tmp_path):
    folder = write_set(tmp_path / "set", markers="centre_of_mass")
    time, points = gait_track()
    write_track(folder, time, points.mean(axis=1) * 1000)
    assert any("t1.csv" in line and "millimetres" in line for line in found(folder))


def test_wrong_number_of_markers(folder):
    time, points = gait_track(links=4)
    write_track(folder, time, points)
    assert any("t1.csv:1" in line and "4 markers" in line and "5 links" in line for line in found(folder))


def test_head_to_tail(folder):
    time, points = gait_track()
    write_track(folder, time, points[:, ::-1])
    assert any("head to tail" in line for line in found(folder))


def test_columns(folder):
    edit(folder / "trials.csv", "offset,", "ofset,")
    listed = found(folder)
    assert any("trials.csv:1" in line and "'offset' is missing" in line for line in listed)
    assert any("did you mean 'offset'" in line for line in listed)


def test_unknown_column_is_a_warning(folder):
    text = (folder / "trials.csv").read_text().splitlines()
    (folder / "trials.csv").write_text(
        "\n".join([text[0] + ",weather", *(t + ",fine" for t in text[1:])]) + "\n"
    )
    assert found(folder) == []
    assert any("'weather'" in line for line in found(folder, "warning"))


@pytest.mark.parametrize("name", ["../robot.yaml", "/etc/hostname", "a/../../robot.yaml"])
def test_no_way_out_of_the_folder(folder, name):
    (folder.parent / "robot.yaml").write_text("name: other\n")
    edit(folder / "dataset.yaml", "robot: robot.yaml", f"robot: {name}")
    assert any("folder" in line for line in found(folder))


@pytest.mark.parametrize("name", ["../t1", "/tmp/t1", "sub/t1", "..\\\\t1"])
def test_no_trial_outside(folder, name):
    edit(folder / "trials.csv", "t1,", f"{name},")
    assert any("trials.csv:2: trial:" in line for line in found(folder))


def test_no_link_out_of_the_folder(folder):
    (folder.parent / "elsewhere.csv").write_text((folder / "trials" / "t1.csv").read_text())
    (folder / "trials" / "t1.csv").unlink()
    (folder / "robot.yaml").rename(folder.parent / "robot.yaml")
    (folder / "robot.yaml").symlink_to(folder.parent / "robot.yaml")
    listed = found(folder)
    assert any("link?" in line for line in listed)
    assert any("t1.csv is missing" in line for line in listed)


def test_duplicate_names_and_replicates(folder):
    (folder / "trials.csv").write_text(
        HEADER.strip()
        + ",replicate_of\n"
        + "t1,2,48,0,1.57,0,2,\nT1,2,48,0,1.57,0,2,\nt2,2,48,0,1.57,0,2,t9\n"
    )
    listed = found(folder)
    assert any("trials.csv:3" in line and "already on line 2" in line for line in listed)
    assert any("no trial 't9'" in line for line in listed)


def test_durations(folder):
    edit(folder / "trials.csv", "0,2.0\nt2", "0,3.0\nt2")
    assert any("t1.csv" in line and "duration_s 3" in line for line in found(folder))


def test_bad_cells_are_named(folder):
    path = folder / "trials" / "t1.csv"
    lines = path.read_text().splitlines()
    lines[7] = lines[7].replace(lines[7].split(",")[3], "0.1O", 1)
    lines[9] += ",1"
    lines[11] = lines[11].replace(lines[11].split(",")[2], "inf", 1)
    path.write_text("\n".join(lines) + "\n")
    listed = found(folder)
    assert any("t1.csv:8: x2_m" in line and "0.1O" in line for line in listed)
    assert any("t1.csv:10" in line and "12 cells" in line for line in listed)
    assert any("t1.csv:12: y1_m" in line for line in listed)


def test_schedules(folder):
    (folder / "schedules").mkdir()
    (folder / "schedules" / "s.csv").write_text("segment,on_s,off_s,period_s\n9,0,0.1,0.5\n1,0,100,0.5\n")
    text = (folder / "trials.csv").read_text().splitlines()
    rows = [text[0] + ",schedule", text[1] + ",s", text[2] + ",gone"]
    (folder / "trials.csv").write_text("\n".join(rows) + "\n")
    listed = found(folder)
    assert any("s.csv:2" in line and "1 to 4" in line for line in listed)
    assert any("s.csv:3" in line and "milliseconds" in line for line in listed)
    assert any("trials.csv:3" in line and "gone" in line for line in listed)

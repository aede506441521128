"""Recordings of every layout end in the same data set; what is wrong or guessed is said."""

import contextlib
import json
import math
from functools import lru_cache

import layout_writers as write
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from measure_fixtures import ROBOT
from motive_writer import motive_csv
from test_motive_import import COLUMNS, START, TIME, imported, lab_tracks

from srs_opt.command import run_command
from srs_opt.errors import InputError
from srs_opt.import_tracks.__main__ import build_parser, run
from srs_opt.measurement.chain import chain_of
from srs_opt.measurement.dataset import load_dataset
from srs_opt.measurement.direction import head_first
from srs_opt.measurement.onset import find_onset
from srs_opt.measurement.takes.formats import read_take
from srs_opt.measurement.takes.take import ReadSettings
from srs_opt.measurement.valve_wave import ValveWave, first_curvatures
from virtual_lab.simulate import run as run_lab
from virtual_lab.trials import Schedule as LabSchedule
from virtual_lab.trials import Trial as LabTrial
from virtual_lab.truth import Truth

RATE = 120.0
NAMES = ["a", "b", "c", "d", "e"]
ROW = f"m1,1.5,48,0.4,1.570796,{START}"
MIXED = [3, 0, 4, 1, 2]  # order of the markers in the file


@lru_cache
def texts():
    points = lab_tracks()[1][:, MIXED]
    return {
        "qualisys.tsv": write.qualisys(points, RATE, NAMES),
        "vicon.csv": write.vicon(points, RATE, NAMES),
        "take.trc": write.trc(points, RATE, NAMES),
        "deeplabcut.csv": write.deeplabcut(points, NAMES),
        "plain.csv": write.plain(points, RATE, NAMES),
        "rows.csv": write.motive_rows(points, RATE, [7, 5, 9, 2, 11]),
        "take.c3d": write.c3d(points, RATE, NAMES),
    }


def import_take(folder, name, *extra, status=0, out="out"):
    """Import a file of the folder with the folder's list.csv, into its subfolder `out`."""
    argv = [str(folder / name), "--trials", str(folder / "list.csv"), "--out", str(folder / out), *extra]
    assert run_command(build_parser(), run, argv) == status


def import_file(folder, name, data, row=ROW, *extra, status=0):
    path = folder / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    (folder / "list.csv").write_text(f"{COLUMNS},valve_start_s\n{row}\n")
    import_take(folder, name, "--quiet", *extra, status=status)
    return load_dataset(folder / "out").trials[0] if status == 0 else None


@pytest.mark.parametrize("name", texts())
def test_every_layout_gives_the_same_tracks(tmp_path, name):
    if name.endswith("c3d"):
        pytest.importorskip("ezc3d")
    extra = ["--rate", "120", "--scale", str(1 / 900)] if name == "deeplabcut.csv" else []
    row = ROW if name != "plain.csv" else f"m1,1.5,48,0.4,1.570796,{START - 0.5}"
    trial = import_file(tmp_path, name, texts()[name], row, *extra)
    exact, points = lab_tracks()
    first = math.ceil(START * RATE - 0.5)
    assert trial.time_s[0] == pytest.approx(first / RATE - START, abs=1e-4)
    assert trial.markers_m.shape == (len(TIME) - first, 5, 2)
    gap = np.linalg.norm(trial.markers_m - (exact[first:] - exact[0, 0]), axis=2)
    assert np.nanquantile(gap, 0.99) < 3e-3
    assert np.isfinite(gap).mean() == pytest.approx(np.isfinite(points[first:, :, 0]).mean(), abs=0.01)


def test_deeplabcut_hdf5(tmp_path):
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("tables")
    columns = pandas.MultiIndex.from_product([["net"], NAMES, ["x", "y", "likelihood"]])
    values = np.ones((30, 15)) * np.arange(15)
    pandas.DataFrame(values, columns=columns).to_hdf(tmp_path / "t.h5", key="df_with_missing")
    take = read_take(tmp_path / "t.h5", ReadSettings(rate_hz=30))
    assert take.markers == tuple(NAMES)
    assert take.marker_positions[3, 2].tolist() == [6, -7, 0]


HEAD = "Format Version,1.22,Take Name,m1,Export Frame Rate,120,Length Units,Meters"


def motive_text(**options):
    return motive_csv(lab_tracks()[1], take="m1", **options)


MOTIVE = {
    "row labels left empty": lambda t: (
        t.replace(",Type,", ",,").replace(",Name,", ",,").replace(",ID,", ",,")
    ),
    "notes with a comma": lambda t: t.replace("Rotation Type", "Take Notes,slow, with hose,Rotation Type"),
    "semicolons and decimal commas": lambda t: t.replace(",", ";").replace(".", ","),
    "no units": lambda t: t.replace("Length Units,Meters,", ""),
    "not-a-number as Windows writes it": lambda t: t.replace(",,", ",-nan(ind),").replace(
        "-nan(ind),Type", ",Type"
    ),
    "UTF-16": lambda t: t.encode("utf-16"),
    "Latin-1": lambda t: t.replace("Take Name,m1", "Take Name,Größe").encode("latin-1"),
    "dropped rows": lambda t: "\r\n".join(
        r for k, r in enumerate(t.split("\r\n")) if k not in range(300, 320)
    ),
    "time code": lambda t: "\r\n".join(_with_timecode(t.split("\r\n"))),
}


def _with_timecode(lines):
    for line in lines:
        cells = line.split(",")
        word = "TimeCode" if cells[0] == "Frame" else "15:26:46:00" if cells[0].isdigit() else ""
        yield (
            ",".join([*cells[:2], word, *cells[2:]])
            if len(cells) > 20 and cells[0] != "Format Version"
            else line
        )


@pytest.mark.parametrize("case", MOTIVE)
def test_motive_as_found_in_laboratories(tmp_path, case):
    trial = import_file(tmp_path, "m1.csv", MOTIVE[case](motive_text()))
    exact, _ = lab_tracks()
    first = math.ceil(START * RATE - 0.5)
    gap = np.linalg.norm(trial.markers_m - (exact[first:] - exact[0, 0]), axis=2)
    assert np.nanquantile(gap, 0.99) < 3e-3
    assert np.isnan(gap[300 - first : 305 - first]).all() == (case == "dropped rows")


def test_notes_do_not_turn_millimetres_into_metres(tmp_path):
    text = motive_text(units="Millimeters").replace(
        "Rotation Type", "Take Notes,slow, with hose,Rotation Type"
    )
    (tmp_path / "t.csv").write_text(text)
    assert read_take(tmp_path / "t.csv").scale_m == 1e-3


def test_the_clock_is_the_takes_own(tmp_path):
    """A take cut to start at 2 s, with the valves' start on the same clock."""
    lines = motive_text().split("\r\n")
    at = next(k for k, line in enumerate(lines) if line.startswith("Frame"))
    moved = []
    for line in lines[at + 1 : -1]:
        frame, time, rest = line.split(",", 2)
        moved.append(f"{int(frame) + 240},{float(time) + 2:.6f},{rest}")
    trial = import_file(
        tmp_path, "m1.csv", "\r\n".join([*lines[: at + 1], *moved]), f"m1,1.5,48,0.4,1.570796,{START + 2}"
    )
    exact, _ = lab_tracks()
    first = math.ceil(START * RATE - 0.5)
    gap = np.linalg.norm(trial.markers_m - (exact[first:] - exact[0, 0]), axis=2)
    assert np.nanquantile(gap, 0.99) < 3e-3


def test_two_takes_of_one_name_are_refused(tmp_path, capsys):
    texts = {
        "x": motive_csv(lab_tracks()[1], take="same"),
        "y": motive_csv(lab_tracks(seed=1)[1], take="same"),
    }
    imported(tmp_path, texts, ["same,1.5,48,0.4,1.570796"], status=2)
    assert "2 takes are called 'same'" in capsys.readouterr().err


def test_more_markers_than_links_are_not_ghosts(tmp_path, capsys):
    points = lab_tracks()[1]
    both = np.concatenate([points, (points[:, 1:] + points[:, :-1]) / 2], axis=1)
    import_file(tmp_path, "t.csv", write.plain(both, RATE, [f"m{i}" for i in range(9)]), ROW, status=2)
    assert "positions, the robot has 5 links" in capsys.readouterr().err


def test_a_take_in_mid_gait_is_told(tmp_path, capsys):
    late = f"m1,1.5,48,0.4,1.570796,{START + 1.3}"
    for row, told in ((ROW, False), (late, True)):
        folder = tmp_path / str(told)
        folder.mkdir()
        (folder / "m1.csv").write_text(motive_text())
        (folder / "list.csv").write_text(f"{COLUMNS},valve_start_s\n{row}\n")
        import_take(folder, "m1.csv", "--json")
        said = json.loads(capsys.readouterr().out)["trials"][0]["warnings"]
        assert any("mid-gait" in word for word in said) == told


def test_schedules_come_along(tmp_path):
    (tmp_path / "s.csv").write_text(
        "segment, on_s, off_s, period_s\n" + "".join(f"{i}, 0.1, 0.3, 0.5\n" for i in (1, 2, 3, 4))
    )
    (tmp_path / "m1.csv").write_text(motive_text())
    (tmp_path / "list.csv").write_text(f"{COLUMNS},valve_start_s,schedule\nm1,,48,,,{START},s\n")
    import_take(tmp_path, "m1.csv", "--quiet")
    trial = load_dataset(tmp_path / "out").trials[0]
    assert trial.schedule.intervals[0] == (1, 0.1, 0.3)
    assert trial.frequency_hz == 2


@pytest.mark.parametrize("backwards", [False, True])
def test_head_and_tail_by_the_bends_not_by_the_travel(backwards):
    """On isotropic ground the robot goes along its wave: the bends still tell, and the conflict is said."""
    _, points = lab_tracks(offset=0.0)
    points = points[120:]  # moving
    drift = np.linspace(0, 1, len(points))[:, None, None] * np.array([math.cos(0.7), math.sin(0.7)])
    tracks = points - (2.0 * drift if backwards else 0)
    said = []
    turned = head_first(
        chain_of(ROBOT), ("p", "q"), TIME[120:], tracks[:, ::-1], 1.5, math.pi / 2, None, said
    )
    assert turned
    assert any("disagree" in word for word in said) == backwards
    said = []
    assert not head_first(chain_of(ROBOT), ("p", "q"), TIME[120:], tracks, 1.5, -math.pi / 2, "q", said)
    assert any("against the phase lag" in word for word in said)


def test_a_start_that_cannot_be_told_says_so():
    """The wrong gait does not get an onset of 20 ms: the start is bracketed by the first motion."""
    _, points = lab_tracks(offset=0.0)
    right = find_onset(ROBOT, ValveWave(1.5, 48, 0.0, math.pi / 2), TIME, points)
    assert not right.doubt
    assert abs(right.time_s - START) < 5 * right.sd_s + 2e-3
    wrong = find_onset(ROBOT, ValveWave(1.5, 48, 0.0, math.pi), TIME, points)
    assert wrong.doubt or wrong.sd_s > 5 * right.sd_s
    assert abs(wrong.time_s - START) < 4 * wrong.sd_s
    moved = first_curvatures(ROBOT, ValveWave(1.5, 48, 0.0, math.pi / 2), np.array([0.0, 0.1]))
    assert moved[0].tolist() == [0, 0, 0, 0]


def test_columns_by_hand(tmp_path):
    text = "zeit;A1;A2;B1;B2\n" + "".join(f"{40 * k};{k},5;0;{k + 49};0\n" for k in range(5))
    (tmp_path / "t.txt").write_text(text)
    columns = {
        "time": "zeit",
        "time_unit": "ms",
        "length_unit": "mm",
        "markers": {"tail": ["A1", 3], "head": [4, "B2"]},
    }
    take = read_take(tmp_path / "t.txt", ReadSettings(columns=columns))
    assert (take.rate_hz, take.scale_m, take.markers) == (25, 1e-3, ("tail", "head"))
    assert take.marker_positions[2].tolist() == [[2.5, 0, 0], [51, 0, 0]]
    with pytest.raises(InputError, match="no column 9"):
        read_take(tmp_path / "t.txt", ReadSettings(columns={**columns, "markers": {"a": [9, 1]}}))


def test_what_was_guessed_is_told(tmp_path, capsys):
    (tmp_path / "list.csv").write_text(f"{COLUMNS},valve_start_s\n{ROW}\n")
    (tmp_path / "t.tsv").write_text(texts()["qualisys.tsv"])
    import_take(tmp_path, "t.tsv", "--json", out="o")
    said = json.loads(capsys.readouterr().out)["trials"][0]["warnings"]
    assert any("millimetres" in word for word in said)
    assert any("0, 0, 0" in word for word in said)
    import_file(tmp_path, "d.csv", texts()["deeplabcut.csv"], ROW, status=2)
    assert "--rate" in capsys.readouterr().err
    import_file(tmp_path, "d.csv", texts()["deeplabcut.csv"], ROW, "--rate", "120", status=2)
    assert "--scale" in capsys.readouterr().err


TEXT = st.text(alphabet=st.sampled_from(list("0123456789.,-+eE\n\r\"' ;\tnaxyzXYZFrameTi\x00é")), max_size=60)


@pytest.mark.parametrize("name", texts())
@given(data=st.data())
@settings(max_examples=15, deadline=None, suppress_health_check=list(HealthCheck))
def test_any_bytes_give_a_take_or_an_input_error(tmp_path, name, data):
    if name.endswith("c3d"):
        pytest.importorskip("ezc3d")
    whole = SHORT[name]
    cut = data.draw(st.integers(0, len(whole)))
    raw = data.draw(st.one_of(st.binary(max_size=40), TEXT.map(str.encode)))
    path = tmp_path / name
    path.write_bytes(data.draw(st.sampled_from([raw, whole[:cut] + raw + whole[cut:], whole[:cut] + raw])))
    with contextlib.suppress(InputError):
        assert read_take(path, ReadSettings(rate_hz=30.0)).marker_positions.shape[2] == 3


_FEW = lab_tracks()[1][:6, MIXED]
SHORT = {
    "qualisys.tsv": write.qualisys(_FEW, RATE, NAMES).encode(),
    "vicon.csv": write.vicon(_FEW, RATE, NAMES).encode(),
    "take.trc": write.trc(_FEW, RATE, NAMES).encode(),
    "deeplabcut.csv": write.deeplabcut(_FEW, NAMES).encode(),
    "plain.csv": write.plain(_FEW, RATE, NAMES).encode(),
    "rows.csv": write.motive_rows(_FEW, RATE, [7, 5, 9, 2, 11]).encode(),
    "take.c3d": write.c3d(_FEW, RATE, NAMES),
}


def step_take(moves, sd=2e-4):
    """Markers of a snake that presses its second segment a second into the take, or never."""
    rng, time_s = np.random.default_rng(2), np.arange(300) / RATE
    held = LabTrial("s", 1e-9, 55.0, schedule=LabSchedule(((2, 0.0, 10.0),), 10.0), kind="step")
    path = run_lab(Truth(), held, np.maximum(time_s - 1.0, 0) if moves else np.zeros(300))
    exact = np.stack([path.x, path.y], axis=-1)
    return exact + sd * rng.normal(size=exact.shape)


def import_step(folder, moves, status):
    (folder / "s.trc").write_text(write.trc(step_take(moves), RATE, NAMES))
    (folder / "list.csv").write_text(f"{COLUMNS},kind\ns,0,55,0,0,step\n")
    import_take(folder, "s.trc", "--quiet", status=status)


def test_a_static_test_begins_shortly_before_its_first_motion(tmp_path):
    import_step(tmp_path, True, 0)
    (trial,) = load_dataset(tmp_path / "out").trials
    assert trial.kind == "step"
    begun = 300 / RATE - (trial.time_s[-1] - trial.time_s[0])
    assert 0.5 < begun < 1.05


def test_a_static_test_in_which_nothing_moves_asks_for_its_start(tmp_path, capsys):
    import_step(tmp_path, False, 2)
    assert "give valve_start_s" in capsys.readouterr().err

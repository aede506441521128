"""Motive exports become data sets, whatever their axes, units, labels, gaps, swaps and ghosts."""

import json
import math
from functools import lru_cache

import numpy as np
import pytest
from measure_fixtures import ROBOT
from motive_writer import ROT, motive_csv, take_text

from srs_opt.command import run_command
from srs_opt.errors import InputError
from srs_opt.import_tracks.__main__ import build_parser
from srs_opt.import_tracks.__main__ import run as import_run
from srs_opt.measurement.chain import chain_of, link_positions
from srs_opt.measurement.dataset import load_dataset
from srs_opt.measurement.find_chain import find_chain
from srs_opt.measurement.ground import ground_axes
from srs_opt.measurement.takes.formats import read_take
from virtual_lab.simulate import run
from virtual_lab.trials import Trial as LabTrial
from virtual_lab.truth import Truth

START, TIME = 0.8137, np.arange(600) / 120
COLUMNS = "trial,frequency_hz,pressure_kpa,offset,phase_lag_rad"
TILTED = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
TILTED = TILTED * np.sign(np.linalg.det(TILTED))
TILTED = TILTED * np.array([[1, 1, 1]]) if TILTED[2, 1] > 0 else TILTED * np.array([[-1], [1], [-1]])


@lru_cache
def lab_path(offset, lag):
    return run(Truth(), LabTrial("a", 1.5, 48.0, offset, lag, 0.7, 4.2), np.maximum(TIME - START, 0))


def lab_tracks(offset=0.4, sd=3e-4, seed=0, lag=math.pi / 2):
    rng = np.random.default_rng(seed)
    path = lab_path(offset, lag)
    exact = np.stack([path.x, path.y], axis=-1)
    points = exact + np.array([0.3, -0.2]) + sd * rng.normal(size=exact.shape)
    points[rng.random(points.shape[:2]) < 0.05] = np.nan
    points[200:240, 2] = np.nan
    return exact, points


def ghosts():
    made = np.full((len(TIME), 2, 3), np.nan)
    made[100:300, 0] = [0.35, 0.06, -0.1]
    made[310:320, 1] = [0.2, 0.06, 0.3]
    return made


def imported(tmp_path, texts, rows, *extra, status=0):
    paths = []
    for name, text in texts.items():
        (tmp_path / f"{name}.csv").write_text(text)
        paths.append(str(tmp_path / f"{name}.csv"))
    (tmp_path / "list.csv").write_text("\n".join([COLUMNS, *rows]) + "\n")
    argv = [*paths, "--trials", str(tmp_path / "list.csv"), "--out", str(tmp_path / "out"), "--quiet", *extra]
    assert run_command(build_parser(), import_run, argv) == status
    return load_dataset(tmp_path / "out") if status == 0 else None


CASES = {
    "y up": {"axes": ROT["y"], "normal": (0, 1, 0)},
    "z up": {"axes": ROT["z"], "normal": (0, 0, 1)},
    "tilted": {"axes": TILTED[:2], "normal": tuple(TILTED[2])},
    "millimetres": {"units": "Millimeters"},
    "swaps": {"swap_at": 250},
    "ghosts": {"ghosts": ghosts()},
    "rigid body markers": {"kind": "Rigid Body Marker", "swap_at": 300},
}


@pytest.mark.parametrize("case", CASES)
def test_round_trip(tmp_path, case):
    exact, points = lab_tracks()
    dataset = imported(
        tmp_path, {"m1": motive_csv(points, take="m1", **CASES[case])}, ["m1,1.5,48,0.4,1.570796"]
    )
    trial = dataset.trials[0]
    first = int(np.argmin(np.abs(TIME - START - trial.time_s[0])))
    truth = exact[first : first + len(trial.time_s)] - exact[0, 0]
    turn = trial.heading_rad - 0.7
    rotated = truth @ np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    gap = np.linalg.norm(trial.markers_m - rotated, axis=2)
    assert np.nanquantile(gap, 0.99) < 3e-3
    assert np.isfinite(gap).mean() > 0.9
    assert abs((TIME[first] - START) - trial.time_s[0]) < 0.006
    assert dataset.marker_sd_m == pytest.approx(3e-4, rel=0.15)
    if case != "tilted":
        assert turn == pytest.approx(0, abs=0.01)


def test_head_by_label_and_by_motion(tmp_path):
    _, points = lab_tracks()
    names = ["tail", "b", "c", "d", "head"]
    text = motive_csv(points, labels=names)
    by_label = imported(tmp_path, {"m1": text}, ["m1,1.5,48,0.4,1.570796"], "--head-marker", "head")
    assert by_label.trials[0].heading_rad == pytest.approx(0.7, abs=0.01)
    (tmp_path / "out" / "dataset.yaml").unlink()
    other = imported(
        tmp_path, {"m1": text}, ["m1,1.5,48,0.4,1.570796"], "--head-marker", "tail", "--valve-start", "0.8"
    )
    assert abs(math.remainder(other.trials[0].heading_rad - 0.7 - math.pi, 2 * math.pi)) < 0.01


def test_seen_from_below_is_noticed(tmp_path, capsys):
    _, points = lab_tracks()
    (tmp_path / "m1.csv").write_text(motive_csv(points))
    (tmp_path / "list.csv").write_text(COLUMNS + "\nm1,1.5,48,0.4,1.570796\n")
    argv = [str(tmp_path / "m1.csv"), "--trials", str(tmp_path / "list.csv"), "--out", str(tmp_path / "out")]
    assert run_command(build_parser(), import_run, [*argv, "--up=-y", "--valve-start", "0.81", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert any("--up" in warning for warning in record["trials"][0]["warnings"])


def test_one_rigid_body_per_link(tmp_path):
    _, points = lab_tracks()
    text = motive_csv(points, kind="Rigid Body", labels=["L1", "L2", "L3", "L4", "L5"])
    dataset = imported(tmp_path, {"m1": text}, ["m1,1.5,48,0.4,1.570796"])
    assert dataset.trials[0].markers_m.shape[1] == 5


def test_rotations_and_raw_markers_are_told_apart(tmp_path):
    """A rigid body's rotation and its model of a marker do not hide what the cameras saw."""
    lines = [
        "Format Version,1.23,Take Name,T,Export Frame Rate,100,Length Units,Millimeters",
        "",
        ",Type," + ",".join(["Rigid Body"] * 8 + ["Rigid Body Marker"] * 4 + ["Marker"] * 3),
        ",Name," + ",".join(["Snake"] * 8 + ["Snake:Marker1"] * 7),
        ",ID," + ",".join(["1"] * 15),
        ",Parent," + ",".join([""] * 15),
        ",,"
        + ",".join(["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"] + ["Position"] * 3)
        + ",Marker Quality,"
        + ",".join(["Position"] * 3),
        "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z,,X,Y,Z",
        "0,0.0,0,0,0,1,10,20,30,0.1,1,2,3,1.0,4,5,6",
        "1,0.01,0,0,0,1,10,20,30,0.1,1,2,3,1.0,,,",
    ]
    path = tmp_path / "t.csv"
    path.write_text("\n".join(lines) + "\n")
    take = read_take(path)
    assert take.bodies == ("Snake",)
    assert take.markers == ("Snake:Marker1",)
    assert np.allclose(take.body_positions[0, 0], [10, 20, 30])
    assert np.allclose(take.marker_positions[0, 0], [4, 5, 6])
    assert np.isnan(take.marker_positions[1]).all()
    assert (take.name, take.rate_hz) == ("T", 100)


BAD = {
    "no header": ("a,b\n1,2\n", "not a recording in a known format"),
    "units": ("Format Version,1.22,Length Units,Furlongs\nFrame,Time\n0,0\n", "length units"),
    "no frames": ("Format Version,1.22\n,Type,Marker\n", "Frame"),
    "no rows": ("Format Version,1.22\nFrame,Time,X,Y,Z\n", "no frames"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_takes(tmp_path, case):
    path = tmp_path / "t.csv"
    path.write_text(BAD[case][0])
    with pytest.raises(InputError, match=BAD[case][1]):
        read_take(path)


def test_bad_cells_are_named(tmp_path):
    _, points = lab_tracks()
    lines = motive_csv(points).split("\r\n")
    path = tmp_path / "t.csv"
    path.write_text("\r\n".join([*lines[:20], lines[20].replace(".", ";", 2), *lines[21:]]))
    with pytest.raises(InputError, match=r"t\.csv:21"):
        read_take(path)
    swapped = [*lines[:20], lines[21], lines[20], *lines[22:]]
    path.write_text("\r\n".join(swapped))
    with pytest.raises(InputError, match="does not increase"):
        read_take(path)


def test_wrong_robot_and_missing_take(tmp_path, capsys):
    _, points = lab_tracks()
    imported(tmp_path, {"m1": motive_csv(points * 1000)}, ["m1,1.5,48,0.4,1.57"], status=2)
    assert "in a row" in capsys.readouterr().err
    texts = {"m1": motive_csv(points), "m2": motive_csv(points, take="Take 2")}
    imported(tmp_path, texts, ["m3,1.5,48,0.4,1.57"], status=2)
    assert "no take is called 'm3'" in capsys.readouterr().err
    imported(tmp_path, {"m1": motive_csv(points[:, :4])}, ["m1,1.5,48,0.4,1.57"], status=2)
    assert "4 markers" in capsys.readouterr().err


def test_existing_sets_are_not_overwritten(tmp_path, capsys):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "dataset.yaml").write_text("name: precious\n")
    _, points = lab_tracks()
    imported(tmp_path, {"m1": motive_csv(points)}, ["m1,1.5,48,0.4,1.57"], status=2)
    assert "already holds" in capsys.readouterr().err


def test_a_take_that_never_moves_asks_for_the_start(tmp_path, capsys):
    _, points = lab_tracks()
    rng = np.random.default_rng(0)
    rest = points[:1] * 0 + np.arange(5)[None, :, None] * np.array([0.049, 0.0])
    still = rest + 3e-4 * rng.normal(size=(300, 5, 2))
    imported(tmp_path, {"m1": motive_csv(np.nan_to_num(still))}, ["m1,1.5,48,0.4,1.57"], status=1)
    assert "valve_start_s" in capsys.readouterr().err


def test_chain_among_ghosts():
    chain = chain_of(ROBOT)
    rng = np.random.default_rng(0)
    for seed in range(20):
        q = np.r_[rng.normal(size=3), 8 * rng.normal(size=4).clip(-1.5, 1.5)]
        links = link_positions(chain, q)
        cloud = np.concatenate([links, q[:2] + 0.3 + rng.random((4, 2))])
        order = rng.permutation(len(cloud))
        found = find_chain(chain, cloud[order])
        place = order[found].tolist()
        assert place in ([0, 1, 2, 3, 4], [4, 3, 2, 1, 0]), seed
    assert find_chain(chain, rng.random((6, 2)) * 5) is None


def test_ground_axes_are_right_handed():
    rng = np.random.default_rng(0)
    flat = np.column_stack([rng.normal(size=200), 1e-3 * rng.normal(size=200), 0.2 * rng.normal(size=200)])
    axes, up = ground_axes(flat)
    assert np.allclose(up, [0, 1, 0])
    assert np.allclose(axes, [[1, 0, 0], [0, 0, -1]])
    for name in ("x", "y", "z", "-x", "-y", "-z"):
        axes, up = ground_axes(flat, name)
        assert np.allclose(np.cross(axes[0], axes[1]), up)
    with pytest.raises(InputError, match="up"):
        ground_axes(flat, "w")


def test_take_text_is_what_motive_writes():
    text = take_text(np.zeros((2, 1, 3)), ["a"], 120.0, "Meters", "Marker", "T")
    assert text.startswith("Format Version,1.22,")
    assert "Frame,Time (Seconds),X,Y,Z" in text

"""The calibration end to end, on generated sets with known truths, as laboratories spoil them."""

import json

import numpy as np
import pytest
import yaml

from srs_opt.calibrate.__main__ import main
from srs_opt.measurement.dataset import load_dataset
from srs_opt.robot import load_robot
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.draw import draw_truth
from virtual_lab.trials import small_design, steps_design

TRUTH = draw_truth((), np.random.default_rng(2))
USUAL = Recording()


def made(folder, recording=USUAL, design=None):
    chosen = small_design(np.random.default_rng(3), 2.5)[:6] if design is None else design
    return write_dataset(folder, TRUTH, chosen, 4, recording)


def calibrated(folder, capsys, *options):
    assert main([str(folder), "--json", "--jobs", "1", "--out", str(folder / "out"), *options]) == 0
    said = capsys.readouterr()
    return json.loads(said.out), said.err


def close(answer, most=4.0):
    for name, value in answer["parameters"].items():
        assert abs(value - getattr(TRUTH.parameters, name)) < most * answer["sd"][name], name
    assert 0.95 < answer["misfit"]["after"] < 1.05


@pytest.mark.parametrize(
    ("recording", "design"),
    [
        (USUAL, None),
        (Recording(lost=0.5), None),
        (Recording(markers="centre_of_mass"), None),
        (Recording(bench=True), steps_design(5)),
        (Recording(stated_sd_m=0.002, rate_hz=60.0), None),
    ],
    ids=["tracks", "half the markers lost", "centre of mass", "steps and bench", "noise misstated"],
)
def test_truth_is_found(tmp_path, capsys, recording, design):
    answer, _ = calibrated(made(tmp_path / "set", recording, design), capsys)
    close(answer)
    assert answer["data"] == "tracks"
    assert answer["sd_with_tracks"] is None
    robot = load_robot(tmp_path / "set" / "out" / "robot.yaml")
    assert robot.sources["tau1_s"] == "calibrated"
    assert robot.relative_sd["tau1_s"] == pytest.approx(answer["sd"]["tau1_s"] / robot.tau1_s)


@pytest.mark.parametrize("maps", [False, True], ids=["tracks", "maps"])
def test_a_deviation_of_zero_fixes_a_value(tmp_path, capsys, maps):
    """Trials still scatter about a fixed friction and curvature per pressure."""
    fixed = ("friction_tangential", "friction_normal", "curvature_per_pressure_1_m_kpa")
    folder = made(tmp_path / "set", Recording(maps=maps, tracks=not maps))
    record = yaml.safe_load((folder / "robot.yaml").read_text(encoding="utf-8"))
    record |= {name: getattr(TRUTH.parameters, name) for name in fixed}
    record["relative_sd"] |= dict.fromkeys(fixed, 0.0)
    record["sources"] = {**record.get("sources", {}), **dict.fromkeys(fixed, "bench")}
    (folder / "robot.yaml").write_text(yaml.safe_dump(record), encoding="utf-8")
    answer, _ = calibrated(folder, capsys)
    assert not set(fixed) & {*answer["parameters"], *answer["sd"], *answer["correlation"]}
    assert "tau1_s" in answer["parameters"]
    assert all(
        abs(v - getattr(TRUTH.parameters, n)) < 4 * answer["sd"][n] for n, v in answer["parameters"].items()
    )
    robot = load_robot(folder / "out" / "robot.yaml")
    for name in fixed:
        assert getattr(robot, name) == pytest.approx(record[name], rel=1e-12)
        assert robot.relative_sd[name] == 0
        assert robot.sources[name] == "bench"


def test_any_number_of_processes_gives_the_same(tmp_path, capsys):
    folder = made(tmp_path / "set")
    one, _ = calibrated(folder, capsys)
    two, _ = calibrated(folder, capsys, "--jobs", "2")
    assert (two["parameters"], two["sd"]) == (one["parameters"], one["sd"])  # to the last bit


def test_a_trial_of_nothing_is_left_out_and_said(tmp_path, capsys):
    folder = made(tmp_path / "set")
    file = folder / "trials" / "t02.csv"
    head, *rows = file.read_text().splitlines()
    blank = [row.split(",")[0] + "," * head.count(",") for row in rows]
    file.write_text("\n".join([head, *blank]) + "\n")
    answer, said = calibrated(folder, capsys)
    close(answer)
    assert "trial t02 left out" in said


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda t: np.where(t > 1, t + 0.7, t), "jumps"),
        (lambda t: np.where(t > 1, t - 0.7, t), "time_s"),
        (lambda t: 1000 * t, "milli"),
    ],
    ids=["forward", "backward", "milliseconds"],
)
def test_a_bad_clock_is_refused_with_its_line(tmp_path, capsys, spoil, words):
    folder = made(tmp_path / "set")
    file = folder / "trials" / "t03.csv"
    head, *rows = file.read_text().splitlines()
    times = spoil(np.array([float(row.split(",")[0]) for row in rows]))
    moved = [",".join([f"{t:.6f}", *row.split(",")[1:]]) for t, row in zip(times, rows)]
    file.write_text("\n".join([head, *moved]) + "\n")
    assert main([str(folder), "--quiet", "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "t03.csv" in error and words in error, error
    assert len(error.splitlines()) == 1


def test_markers_in_millimetres_are_refused(tmp_path, capsys):
    folder = made(tmp_path / "set")
    file = folder / "trials" / "t01.csv"
    head, *rows = file.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    scaled = [",".join([t, *(f"{1000 * float(v):.3f}" if v else "" for v in row)]) for t, *row in cells]
    file.write_text("\n".join([head, *scaled]) + "\n")
    assert main([str(folder), "--quiet", "--out", str(tmp_path / "out")]) == 2
    assert "millimetres" in capsys.readouterr().err


def test_steps_on_the_bench_are_read_beside_the_trials(tmp_path):
    bench = load_dataset(made(tmp_path / "set", Recording(bench=True), steps_design(5))).bench
    assert bench.steps and bench.spring_car and bench.tow and bench.checks

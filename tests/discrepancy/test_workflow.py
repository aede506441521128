"""The commands on sets from the virtual laboratory, whose physics is written independently."""

import json
import math
from importlib import resources

import jsonschema
import numpy as np
import pytest

from srs_opt.calibrate.__main__ import main as calibrate
from srs_opt.discrepancy.__main__ import main as discrepancy
from srs_opt.gait import Gait
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import load_robot
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.draw import draw_truth
from virtual_lab.trials import small_design
from virtual_lab.truth import Truth

SCHEMA = json.loads(resources.files("srs_opt.discrepancy").joinpath("discrepancy.schema.json").read_text())


def lab(folder, hidden=(), trials=8, seconds=2.0, seed=5, recording=None, truth=None):
    truth = truth or draw_truth(hidden, np.random.default_rng([seed, 4]), (1.0, 1.0))
    design = small_design(np.random.default_rng([seed, 5]), seconds)[:trials]
    write_dataset(folder, truth, design, seed, recording or Recording(rate_hz=60.0))
    return folder, truth


def ask(command, folder, capsys, *options, out):
    status = command([str(folder), "--json", "--quiet", "--out", str(out), *options])
    said = json.loads(capsys.readouterr().out)
    if command is discrepancy:  # every answer keeps the documented form, printed and written alike
        jsonschema.validate(said, SCHEMA, jsonschema.Draft202012Validator)
        assert json.loads((out / "discrepancy.json").read_text()) == said
    return status, said


@pytest.mark.slow
def test_nothing_hidden_is_nothing_found(tmp_path, capsys):
    folder, truth = lab(tmp_path / "set")
    status, said = ask(discrepancy, folder, capsys, out=tmp_path / "out")
    assert status == 0
    assert said["verdict"] == "no_gap"
    assert said["effects"] == []
    status, found = ask(calibrate, folder, capsys, out=tmp_path / "fit")
    assert status == 0
    assert found["misfit"]["after"] == pytest.approx(1.0, abs=0.02)
    for name, value in found["parameters"].items():
        assert abs(value - getattr(truth.parameters, name)) < 4.5 * found["sd"][name]
    robot = load_robot(tmp_path / "fit" / "robot.yaml")
    assert robot.sources["tau1_s"] == "calibrated"


@pytest.mark.slow
def test_a_tether_is_named_and_closes_the_gap(tmp_path, capsys):
    folder, truth = lab(tmp_path / "set", ("tether_drag",))
    _, said = ask(discrepancy, folder, capsys, "--maze", "mazes/first.yaml", out=tmp_path / "out")
    assert said["verdict"] == "named"
    (effect,) = said["effects"]
    assert effect["name"] == "tether_drag"
    wanted = truth.effects[0]["force_n"]
    assert abs(effect["parameters"]["force_n"] - wanted) < 4.5 * effect["sd"]["force_n"]
    assert said["gap"]["ratio"] < 0.15
    robot = load_robot(said["corrected_robot"])
    assert robot.effects[0]["name"] == "tether_drag"
    gains = {kind: said["payoff"][kind]["speed_m_s"] for kind in ("promised", "before", "after")}
    assert gains["promised"] > gains["after"] > gains["before"]  # a hose makes the promise hollow
    played = steady_gait(robot, Gait.of_record(said["payoff"]["gait_after"]))
    assert played.speed_m_s == pytest.approx(gains["after"], rel=1e-3)
    runs = said["payoff"]["maze"]
    assert runs["after"]["driven"]["reached"] and runs["after"]["driven"]["collisions"] == 0
    # the plan was made for the robot that plays it; the other one did not know of the hose
    assert runs["after"]["open_loop_end_away_m"] < 1e-6 < 0.05 < runs["before"]["open_loop_end_away_m"]
    assert runs["after"]["open_loop_clearance_m"] > 0.0049
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("data:image/png") == 5 and "In a maze" in page
    assert said["effects"][0]["look"] in page and "What acts alike on these data" in page
    # no address: a picture's text may hold the letters of http, but no colon
    assert "tether_drag" in page and "://" not in page and "data:image/png" in page


@pytest.mark.slow
def test_a_late_valve_cannot_be_told_from_an_early_clock(tmp_path, capsys):
    folder, _ = lab(tmp_path / "set", ("dead_time",))
    _, said = ask(discrepancy, folder, capsys, out=tmp_path / "out")
    assert said["verdict"] == "one_of"
    sets = [[said["effects"][0]["name"]], *said["alternatives"]]
    assert sorted(sets) == [["clock_offset"], ["dead_time"]]
    assert "light" in said["next_experiment"]["what"]
    assert said["next_experiment"]["expected_power"] > 0.9
    # the light resolves it
    folder, _ = lab(tmp_path / "lit", ("dead_time",), recording=Recording(rate_hz=60.0, bench=True))
    _, said = ask(discrepancy, folder, capsys, out=tmp_path / "out2")
    assert said["verdict"] == "named"
    assert said["effects"][0]["name"] == "dead_time"


@pytest.mark.slow
def test_a_mislabelled_trial_is_set_aside_by_name(tmp_path, capsys):
    folder, _ = lab(tmp_path / "set")
    table = (folder / "trials.csv").read_text().splitlines()
    header = table[0].split(",")
    rows = [dict(zip(header, line.split(","))) for line in table[1:]]
    wrong = rows[4]
    wrong["pressure_kpa"] = "41.0" if float(wrong["pressure_kpa"]) > 45 else "55.0"
    lines = [table[0], *(",".join(row[k] for k in header) for row in rows)]
    (folder / "trials.csv").write_text("\n".join(lines) + "\n")
    _, said = ask(discrepancy, folder, capsys, "--seed", "1", out=tmp_path / "out2")
    assert said["verdict"] == "no_gap"
    (aside,) = said["set_aside"]
    assert aside["trial"] == wrong["trial"] and "notebook" in aside["reason"]
    assert said["effects"] == []


def test_one_trial_is_not_testable(tmp_path, capsys):
    folder, _ = lab(tmp_path / "set", trials=1, seconds=1.0)
    status, said = ask(discrepancy, folder, capsys, out=tmp_path / "out")
    assert status == 1
    assert said["verdict"] == "not_testable"
    assert "at least 4" in said["why"]
    assert (tmp_path / "out" / "report.html").exists()


def test_maps_alone_calibrate_with_wide_intervals_and_are_not_testable(tmp_path, capsys):
    truth = Truth(relative_sd={"friction_tangential": 0.05, "friction_normal": 0.05})
    recording = Recording(tracks=False, maps=True)
    folder, _ = lab(tmp_path / "set", trials=3, seconds=4.0, recording=recording, truth=truth)
    status, said = ask(discrepancy, folder, capsys, out=tmp_path / "out")
    assert (status, said["verdict"]) == (1, "not_testable")
    status, found = ask(calibrate, folder, capsys, out=tmp_path / "fit")
    assert status == 0
    assert math.isfinite(found["misfit"]["after"])
    assert found["sd"]["friction_normal"] / found["parameters"]["friction_normal"] > 0.005


def test_a_missing_folder_is_bad_input(tmp_path, capsys):
    assert discrepancy([str(tmp_path / "none"), "--json"]) == 2
    assert "none" in capsys.readouterr().err


def test_unknown_effects_are_refused(tmp_path, capsys):
    folder, _ = lab(tmp_path / "set", trials=1, seconds=1.0)
    names = tmp_path / "names.yaml"
    names.write_text("[tether_drug]\n")
    assert discrepancy([str(folder), "--effects", str(names), "--out", str(tmp_path / "o")]) == 2
    assert "tether_drag" in capsys.readouterr().err

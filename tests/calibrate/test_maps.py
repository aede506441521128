"""Calibration from maps alone: derivatives against differences of whole solutions, truth, honesty."""

import json
import math

import numpy as np
import pytest
import yaml

from srs_opt.calibrate.__main__ import main
from srs_opt.calibrate.candidates import fitted_coordinates
from srs_opt.calibrate.coordinates import base_coordinates
from srs_opt.calibrate.maps import parameter_moves, path, robot_at
from srs_opt.gait import Wave
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.draw import draw_truth
from virtual_lab.trials import small_design

FINE = 1e-8


@pytest.mark.parametrize(("offset", "model"), [(0.0, "complex"), (-0.4, "complex"), (-0.4, "simplified")])
def test_derivatives_are_those_of_whole_solutions(offset, model):
    robot = wpi_srs()
    base = base_coordinates(robot)
    gait = Wave.uniform(robot.segments, 1.5, 48.0, math.pi / 2, offset).gait()
    moves = [parameter_moves(robot, {}, c, model) for c in base]
    jacobian = path(robot, steady_gait(robot, gait, model, tolerance=FINE), moves, model)[1]
    for k, coordinate in enumerate(base):
        ends = []
        for sign in (1, -1):
            value = getattr(robot, coordinate.name) * math.exp(sign * 1e-3)
            moved = robot.with_values(**{coordinate.name: value})
            orbit = steady_gait(moved, gait, model, tolerance=FINE)
            ends.append(np.array([orbit.speed_m_s, orbit.turn_rate_rad_s / orbit.speed_m_s]))
        difference = (ends[0] - ends[1]) / 2e-3
        np.testing.assert_allclose(jacobian[:, k], difference, rtol=5e-3, atol=5e-4)


def test_maps_find_the_truth_and_say_how_much_less_they_know(tmp_path, capsys):
    truth = draw_truth((), np.random.default_rng(3))
    design = small_design(np.random.default_rng(4), 3.0)
    write_dataset(tmp_path / "maps", truth, design, 6, Recording(maps=True, tracks=False))
    assert main([str(tmp_path / "maps"), "--json", "--quiet", "--out", str(tmp_path / "out")]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["data"] == "maps"
    assert answer["misfit"]["after"] < 1.5
    assert set(answer["sd_with_tracks"]) == set(answer["sd"])
    for name, value in answer["parameters"].items():
        assert abs(value - getattr(truth.parameters, name)) < 3.5 * answer["sd"][name], name
        assert answer["sd_with_tracks"][name] < answer["sd"][name]


DRAG = {"name": "tether_drag", "force_n": 0.02, "sd": {"force_n": 0.02}}
BIAS = {"name": "segment_bias", "segment": 2, "bias": 0.4, "sd": {"bias": 0.5}}


def test_derivatives_of_a_robots_own_effects_are_those_of_whole_solutions():
    robot = wpi_srs().with_values(effects=[DRAG, BIAS])
    gait = Wave.uniform(robot.segments, 1.5, 48.0, math.pi / 2, 0.2).gait()
    coordinates = fitted_coordinates(robot)[-2:]
    moves = [parameter_moves(robot, {}, c, "complex") for c in coordinates]
    jacobian = path(robot, steady_gait(robot, gait, tolerance=FINE), moves, "complex")[1]
    for k, coordinate in enumerate(coordinates):
        ends = []
        for side in (1, -1):
            moved = robot_at(robot, {coordinate.name: coordinate.start + side * 0.01 * coordinate.typical})
            orbit = steady_gait(moved, gait, tolerance=FINE)
            ends.append(np.array([orbit.speed_m_s, orbit.turn_rate_rad_s / orbit.speed_m_s]))
        difference = (ends[0] - ends[1]) / (0.02 * coordinate.typical)
        np.testing.assert_allclose(jacobian[:, k], difference, rtol=1e-2, atol=1e-3)


def test_maps_refit_an_effect_of_the_robot_and_say_which_they_cannot_show(tmp_path, capsys):
    truth = draw_truth(("tether_drag",), np.random.default_rng(5))
    design = small_design(np.random.default_rng(4), 3.0)[:8]
    write_dataset(tmp_path / "maps", truth, design, 6, Recording(maps=True, tracks=False))
    robot = tmp_path / "maps" / "robot.yaml"
    tilt = {"name": "floor_slope", "angle": 0.001, "direction": 0.0, "sd": {"angle": 0.01}}
    robot.write_text(yaml.safe_dump({**yaml.safe_load(robot.read_text()), "effects": [DRAG, tilt]}))
    assert main([str(tmp_path / "maps"), "--json", "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr()
    answer = json.loads(told.out)
    assert "floor_slope stays as the robot file says" in told.err
    (name,) = (n for n in answer["parameters"] if n.startswith("tether_drag"))
    true = next(e["force_n"] for e in truth.effects if e["name"] == "tether_drag")
    assert abs(answer["parameters"][name] - true) < 3 * answer["sd"][name] < 3 * 0.01

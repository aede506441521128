"""Calibration from maps alone: derivatives against differences of whole solutions, truth, honesty."""

import json
import math

import numpy as np
import pytest

from srs_opt.calibrate.__main__ import main
from srs_opt.calibrate.coordinates import base_coordinates
from srs_opt.calibrate.maps import path
from srs_opt.gait import Wave
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.draw import draw_truth
from virtual_lab.trials import small_design

FINE = 1e-8


@pytest.mark.parametrize("offset", [0.0, -0.4])
@pytest.mark.parametrize("model", ["complex", "simplified"])
def test_slopes_are_those_of_whole_solutions(offset, model):
    robot = wpi_srs()
    base = base_coordinates(robot)
    gait = Wave.uniform(robot.segments, 1.5, 48.0, math.pi / 2, offset).gait()
    slopes = path(robot, steady_gait(robot, gait, model, tolerance=FINE), base, model)[1]
    for k, coordinate in enumerate(base):
        ends = []
        for sign in (1, -1):
            value = getattr(robot, coordinate.name) * math.exp(sign * 1e-3)
            moved = robot.with_values(**{coordinate.name: value})
            orbit = steady_gait(moved, gait, model, tolerance=FINE)
            ends.append(np.array([orbit.speed_m_s, orbit.turn_rate_rad_s / orbit.speed_m_s]))
        difference = (ends[0] - ends[1]) / 2e-3
        np.testing.assert_allclose(slopes[:, k], difference, rtol=5e-3, atol=5e-4)


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

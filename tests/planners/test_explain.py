from dataclasses import replace

import numpy as np
import pytest
from planner_rooms import corridor, gate, maze_of

from planners.maze.raster import Raster
from planners.motion.valves import Joints
from planners.plan.explain import explain, gait_needs, narrower_than_any_gait, tightest_place
from planners.view.obstruction import obstruction_figure
from srs_opt.figures import save_figure


@pytest.mark.parametrize("width", [0.03, 0.05, 0.08, 0.15])
def test_tightest_place_and_its_width(problem_in, width):
    place = tightest_place(problem_in(gate(width)))
    assert (place.x_m, place.y_m) == pytest.approx((1.0, 0.3), abs=0.02)
    assert place.width_m == pytest.approx(width, abs=1e-3)


def test_widest_of_two_gaps_is_taken(problem_in):
    walls = [(0.99, 0.0, 1.01, 0.1), (0.99, 0.14, 1.01, 0.4), (0.99, 0.48, 1.01, 0.6)]
    maze = maze_of((0, 0, 2, 0.6), (0.25, 0.3, 0), (1.7, 0.3, 0.08), walls)
    place = tightest_place(problem_in(maze))
    assert place.y_m == pytest.approx(0.44, abs=0.02)
    assert place.width_m == pytest.approx(0.08, abs=1e-3)


def test_closed_wall_is_said(problem_in, tmp_path):
    walls = [(0.99, 0.0, 1.01, 0.6)]
    problem = problem_in(maze_of((0, 0, 2, 0.6), (0.25, 0.3, 0), (1.7, 0.3, 0.08), walls))
    explanation = explain(problem)
    assert explanation.tightest is None
    assert "completely" in explanation.in_words(None)
    assert explanation.to_record()["width_m"] is None
    for picture in save_figure(obstruction_figure(problem, explanation), tmp_path / "why"):
        assert picture.stat().st_size > 1000


def test_unseen_cells_that_count_as_walls_are_said(problem_in):
    unseen = np.zeros((30, 100), dtype=bool)
    unseen[:, 50] = True
    maze = maze_of((0, 0, 2, 0.6), (0.25, 0.3, 0), (1.7, 0.3, 0.08), [])
    walled = replace(maze, raster=Raster(unseen, 0.02, unknown=unseen))
    words = explain(problem_in(walled)).in_words(None)
    assert "completely" in words and "--unknown free" in words
    seen = replace(maze, raster=Raster(unseen, 0.02))
    assert "--unknown" not in explain(problem_in(seen)).in_words(None)


def test_words_name_place_width_and_needs(problem_in, gaits, tmp_path):
    problem = problem_in(gate(0.045))
    explanation = explain(problem)
    words = explanation.in_words("no way")
    assert "(1.0" in words or "(0.99" in words
    assert "0.045 m wide" in words and "slim" in words and "No gait at all" in words
    pictures = save_figure(obstruction_figure(problem, explanation), tmp_path / "why")
    assert all(picture.exists() for picture in pictures)


def test_weaker_gait_outside_the_table_is_tried(problem_in):
    problem = problem_in(gate(0.0605))
    slimmest = gait_needs(problem)[0][1]
    assert slimmest > 0.0605
    explanation = explain(problem)
    assert explanation.outside_needs_m is not None
    assert explanation.outside_needs_m < slimmest
    assert "outside the table" in explanation.in_words(None)


def test_wide_enough_is_not_called_narrow(problem_in):
    assert not narrower_than_any_gait(problem_in(corridor(0.2)))
    assert narrower_than_any_gait(problem_in(gate(0.05)))


def test_where_widths_allow_a_way_the_assumed_ramp_of_pressure_is_said(problem_in):
    problem = problem_in(corridor(0.2))
    assert "--pressure-rate" in explain(problem).in_words("no plan")
    motion = problem.motion
    measured = replace(motion.joints.limits, pressure_rate_kpa_s=400.0)
    joints = Joints(problem.gaits, measured)
    known = replace(problem, motion=replace(motion, joints=joints))
    assert "--pressure-rate" not in explain(known).in_words("no plan")
    assert "--pressure-rate" not in explain(problem_in(gate(0.045))).in_words("no plan")

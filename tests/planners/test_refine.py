"""Plans refined: Jacobian against differences, faster, certified afresh, playable by valves and firmware."""

import dataclasses
import json
import re
import shutil
from itertools import pairwise

import numpy as np
import pytest
import yaml
from planner_rooms import maze_of
from test_motion_alone import lab_clearance, violations

import planners.refine.refine as refining
from planners.drive.execute import execute
from planners.motion.store import load_motion
from planners.pilot import protocol
from planners.pilot.protocol import Command, Fault
from planners.plan.__main__ import main
from planners.plan.program import plan_program
from planners.plan.solve import solve_with_lattice
from planners.refine.refine import refine
from planners.refine.shots import shoot_windows, with_sensitivity
from planners.refine.window import Window
from planners.search.problem import Problem
from planners.search.tree import at_rest
from planners.view.record import motion_record
from srs_opt.controller.c_source import write_program
from srs_opt.errors import NoAnswerError
from srs_opt.gait_opt.catalogue import default_table
from srs_opt.simulate.timeline import Timeline
from virtual_lab.controller import Controller

BOX = {"box": [0.0, 0.28, 0.62, 0.32]}
PLACES = {"start": {"x": 0.25, "y": 0.14, "heading": 0.0}, "goal": {"x": 0.62, "y": 0.5, "radius": 0.08}}
BEND = {"name": "bend", "bounds": [0, 0, 1.1, 0.8], "walls": [BOX], **PLACES}


@pytest.fixture(scope="module")
def planned(robot):
    """Return a problem, a bend of the way about the end of a wall, and its plan."""
    table = default_table(robot)
    maze = maze_of((0, 0, 1.1, 0.8), (0.25, 0.14, 0.0), (0.62, 0.5, 0.08), [tuple(BOX["box"])])
    problem = Problem(robot, table, load_motion(robot, table), maze, 0.005)
    return problem, solve_with_lattice(problem).plan


@pytest.fixture(scope="module")
def refined(planned):
    return refine(*planned)


def test_slopes_are_those_of_finer_simulations(planned):
    problem, plan = planned
    start = at_rest(problem).state
    numbers = (problem.motion.rest, *plan.gaits)
    joints = [problem.joints.joint(a, b) for a, b in pairwise(numbers[:4])]
    window = Window.of_cycles(joints, problem.joints.limits)
    (shot,) = shoot_windows(problem.integrator, start, [window])
    jacobian = with_sensitivity(problem.integrator, start, shot).sensitivity[-1][:3]
    x = window.unknowns()
    for column in range(1, window.size, 4):
        by = 1e-4 if column < window.size - window.cycles else 0.05
        moved = [window.moved(x + sign * by * np.eye(window.size)[column]) for sign in (1, -1)]
        a, b = (problem.integrator.integrate(w.timeline(), start, 1e-7).final[:3] for w in moved)
        exact = (a - b) / (2 * by)
        assert np.abs(jacobian[:, column] - exact).max() < 0.05 * np.abs(exact).max() + 2e-3


def test_a_plan_becomes_faster_and_is_certified_afresh(planned, refined):
    _, plan = planned
    assert not refined.reason
    assert refined.plan.duration_s < 0.95 * plan.duration_s
    certificate = refined.plan.certificate
    assert certificate.passed and certificate.clearance_m > 0.005 - 2e-6
    assert refined.problem.goal.distance(certificate.pose[-1, :2]) <= 0


def test_valves_play_it_and_the_laboratory_keeps_its_clearance(refined):
    motion = json.loads(json.dumps(motion_record(refined.problem, refined.plan)))
    assert violations(motion, motion["runs"][0]) == {"dwell": 0, "tick": 0, "pressure": 0}
    clearance = lab_clearance(motion, BEND, refine=2.0)
    assert clearance >= refined.plan.certificate.clearance_m - 2e-6


def test_it_is_driven_as_planned_and_left_for_the_tables_gaits_where_it_must(robot, refined):
    driven = execute(refined.problem, refined.plan)
    assert driven.reached and driven.replans == 0
    assert driven.gaits == refined.plan.gaits
    assert driven.duration_s == pytest.approx(refined.plan.duration_s, abs=0.01)
    slippery = dataclasses.replace(robot, friction_tangential=0.8 * robot.friction_tangential)
    other = execute(refined.problem, refined.plan, slippery)
    assert other.reached and not other.collisions


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_firmware_plays_it_by_itself(refined, tmp_path):
    program = plan_program(refined.problem, refined.plan)
    controller = Controller(write_program(program, tmp_path / "plan_program.h"))
    controller.receive(protocol.frame(Command.RUN, 1))
    before = (refined.problem.motion.rest, *refined.plan.gaits)
    pairs = zip(before, refined.plan.gaits)
    wanted = Timeline.join([refined.problem.joints.timeline(a, b) for a, b in pairs])
    ends = np.cumsum(wanted.duration_s)
    played = np.array([controller.tick()[0] for _ in range(300 + round(ends[-1] / 1e-3))])[300:]
    at = np.searchsorted(ends, (np.arange(len(played)) + 0.5) * 1e-3)
    np.testing.assert_array_equal(played, wanted.valve[:, at].T)
    assert controller.fault == Fault.OK


def test_a_plan_that_does_not_become_faster_is_kept(planned, monkeypatch):
    problem, plan = planned
    monkeypatch.setattr(refining, "WINDOW", dataclasses.replace(refining.WINDOW, steps=0))
    kept = refine(problem, plan)
    assert kept.plan is plan and kept.problem is problem
    assert kept.reason
    assert kept.to_record()["to_s"] == kept.to_record()["from_s"]


def test_mending_goes_back_a_window_and_takes_no_more_steps_than_are_left(planned):
    refiner = refining._Refiner(*planned, lambda message: None)
    begin = refiner.places[0]
    refiner.places += [dataclasses.replace(begin, kept=begin.guess[:1] * n) for n in (3, 6, 9)]
    for failed, kept in ((7, 6), (6, 3), (0, 0)):
        refiner.back_to(failed)
        assert len(refiner.places[-1].kept) == kept
    assert refiner.steps_left == round(refining.WINDOW.steps_per_s * planned[1].duration_s)
    refiner.steps_left = 40
    assert (refiner._steps(6), refiner._steps(12)) == (refining.WINDOW.steps, 40 // 3)
    refiner.steps_left = refining.WINDOW.least_steps - 1
    with pytest.raises(NoAnswerError, match="steps"):
        refiner._steps(6)


def test_what_it_cannot_do_is_refused_in_one_line(planned, tmp_path, capsys):
    maze = tmp_path / "bend.yaml"
    maze.write_text(yaml.safe_dump(BEND))
    assert main([str(maze), "--refine", "--cost", "length", "--out", str(tmp_path)]) == 2
    assert "expected --cost time" in capsys.readouterr().err
    path = tmp_path / "robot.yaml"
    path.write_text("effects: [{name: supply_droop, per_hz: 0.1}]\n")
    assert main([str(maze), "--refine", "--robot", str(path), "--out", str(tmp_path)]) == 2
    assert re.search(r"supply_droop.*frequency", capsys.readouterr().err)

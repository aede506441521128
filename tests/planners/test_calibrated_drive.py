"""Measured factors on cycles: steady gaits go as the calibrated drive says, and plans made so arrive."""

import dataclasses

import numpy as np
import pytest
import shapely
from planner_rooms import maze_of

from benchmarks.planner_drive import measured, rows
from planners.motion.bending import Bending
from planners.plan.certify import clearances
from planners.plan.solve import solve_with_lattice
from planners.search.problem import Problem
from planners.search.tree import at_rest
from srs_opt.drive.calibration import DriveCalibration, Factor

FACTORS = DriveCalibration(Factor(0.9, 0.01, 0.02, 5), Factor(1.25, 0.01, 0.02, 5))


@pytest.fixture(scope="module")
def bend_problem(robot, gaits, motion):
    """Return a function from a calibration to a room with a corner to turn round."""
    maze = maze_of((0, 0, 1.6, 1.6), (0.3, 0.3, 0.0), (1.25, 1.2, 0.1), [(0.0, 0.6, 0.9, 1.6)])

    def build(drive=None):
        if drive is None:
            return Problem(robot, gaits, motion, maze, 0.005)
        bent = motion.bent(Bending(drive, motion.course))
        return Problem(robot, gaits, bent, maze, 0.005, drive=drive)

    return build


def test_steady_cycles_are_displaced_as_calibrated(gaits, motion):
    table = motion.bent(Bending(FACTORS, motion.course))
    for index in range(len(gaits.gaits)):
        speed, pose, before = 0.0, np.zeros(3), motion.rest
        bent = np.zeros(3)
        for _ in range(25):
            moved = motion.move(0, 0, 0, before, speed)
            pose = moved.pose[index, -1]
            bent = table.move(0, 0, 0, before, speed).pose[index, -1]
            speed, before = moved.speed_m_s[index], index
        assert bent == pytest.approx(FACTORS.displacement(pose), abs=2e-4)
        assert table.course[index] == pytest.approx(motion.course[index], abs=1e-9)


def test_without_factors_nothing_changes(motion):
    same = motion.bent(Bending(DriveCalibration(), motion.course))
    assert same.pose == pytest.approx(motion.pose, abs=1e-6)


def test_search_table_and_certificate_agree_on_bent_cycles(bend_problem):
    problem = bend_problem(FACTORS)
    plan = solve_with_lattice(problem).plan
    assert plan.certificate.passed
    root = at_rest(problem)
    state, before = root.state, root.gait
    for gait, certified in zip(plan.gaits, plan.certificate.states):
        told = problem.motion.move(*state[:3], before, state[3]).pose[gait]
        cycle = problem.simulate(state, before, gait)
        assert np.hypot(*(cycle.state[:2] - certified[:2])) < 0.001
        assert np.hypot(*(told[-1, :2] - cycle.state[:2])) < 0.012
        state, before = cycle.state, gait


def test_the_drives_uncertainty_is_room_that_a_cycle_keeps(bend_problem):
    sure, unsure = (
        dataclasses.replace(FACTORS, speed=Factor(0.9, 0.0, sd, 5), radius=Factor(1.25, 0.0, sd, 5))
        for sd in (0.0, 0.05)
    )
    least = [solve_with_lattice(bend_problem(drive)).plan.certificate for drive in (sure, unsure)]
    far = [c.clearance_m for c in least]
    assert all(c.passed for c in least)
    cycle = problem_cycle(bend_problem(unsure))
    assert cycle.tube_m == pytest.approx(
        unsure.margin_m(np.hypot(*np.diff(cycle.pose[:, :2], axis=0).T).sum())
    )
    assert min(far) > 0


def problem_cycle(problem):
    root = at_rest(problem)
    return problem.simulate(root.state, root.gait, 0)


@pytest.mark.slow
def test_plans_with_the_drive_arrive_nearer_on_a_robot_with_wider_turns():
    """Radii a quarter larger, of which only a measured map is known; open loop and driven."""
    drive = measured()
    assert drive.radius.value == pytest.approx(1.23, abs=0.05)
    study = rows(("first", "u_turn"))
    misses = np.array([row[1] for row in study])
    assert (misses[:, 1] < 0.5 * misses[:, 0]).all()
    replans = np.array([row[2] for row in study])
    assert replans[:, 1].sum() <= replans[:, 0].sum()
    assert all(arrived[1] for *_, arrived in study)


def test_room_that_an_uncertain_drive_keeps_is_measured_exactly(bend_problem):
    """Far from walls a certificate takes the distance table's lower bound, but not where more is wanted."""
    problem = bend_problem()
    lines = solve_with_lattice(problem).plan.certificate.lines[::20]
    exact = np.array([problem.maze.clearance(shapely.LineString(line)) for line in lines])
    exact -= problem.robot.body_width_m / 2
    np.testing.assert_allclose(clearances(problem, lines, 1.0), exact, atol=1e-9)
    bound = clearances(problem, lines)
    assert (bound <= exact + 1e-9).all() and (bound < exact - 1e-3).any()

"""Planning and driving for bodies that bend; soft robots under rigid plans."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from planner_rooms import corridor

from planners.drive.execute import execute
from planners.drive.friction_ensemble import _yielding
from planners.motion.deviation import cycle_deviation_m
from planners.motion.transitions import motion_table, simulate_transitions
from planners.plan.inputs import placed_maze, planning_problem
from planners.plan.looks import looks
from planners.plan.solve import solve_with_lattice
from planners.search.problem import Problem
from srs_opt.gait_opt.catalogue import shipped_table
from srs_opt.gait_opt.table import GaitTable, TableGait
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.timeline import Timeline
from virtual_lab.live import LiveRobot
from virtual_lab.truth import Parameters, Truth

FIRST = Path(__file__).parents[2] / "mazes" / "first.yaml"


def soft(stiffness):
    return wpi_srs().with_values(bending_stiffness_n_m2=stiffness)


@pytest.fixture(scope="module")
def soft_problem(gaits):
    robot = soft(0.005)
    orbits = [(e.name, steady_gait(robot, e.gait, "compliant")) for e in gaits.gaits]
    entries = [TableGait.of_orbit(name, o) for name, o in orbits if o.largest_multiplier < 1]
    table = GaitTable(robot.name, robot.fingerprint(), "compliant", tuple(entries))
    motion = motion_table(robot, table, simulate_transitions(robot, table))
    return Problem(robot, table, motion, corridor(0.3, 2.0), 0.005)


def test_the_gaits_are_run_on_the_soft_body(gaits, soft_problem):
    table = soft_problem.gaits
    assert table.model == "compliant"
    assert table.fingerprint == soft(0.005).fingerprint()
    assert table["fast"].gait == gaits["fast"].gait
    assert table["fast"].speed_m_s == pytest.approx(0.404, rel=0.01)  # an independent program's


def test_a_plan_is_the_motion_of_the_soft_body(soft_problem):
    plan = solve_with_lattice(soft_problem).plan
    assert plan.certificate.passed
    run, start = Integrator(soft_problem.robot), soft_problem.start
    gaits = [soft_problem.gaits.gaits[k].gait for k in plan.gaits]
    line = Timeline.join([Timeline.of_gait(g, g.period_s) for g in gaits])
    path = run.integrate(line, run.rest(start.x, start.y, start.heading))
    for time, pose in zip(plan.certificate.time_s[::50], plan.certificate.pose[::50]):
        place, _ = path.at(np.array([time]))
        np.testing.assert_allclose(pose, place[0], atol=2e-3)


def test_a_plan_played_open_loop_on_the_laboratorys_soft_body_ends_where_it_should(soft_problem):
    """Another formulation plays the valves; nobody steers."""
    plan = solve_with_lattice(soft_problem).plan
    start, certificate = soft_problem.start, plan.certificate
    truth = Truth(Parameters(bending_stiffness_n_m2=0.005), friction_speed_m_s=0.002)
    robot = LiveRobot(truth, start.x, start.y, start.heading)
    off = []
    for before, k in zip((soft_problem.motion.rest, *plan.gaits), plan.gaits):
        line = soft_problem.joints.timeline(before, k)
        for duration, valves, pressure in zip(line.duration_s, line.valve.T, line.pressure_kpa):
            robot.advance(valves, float(pressure), float(duration))
        if robot.time_s > certificate.time_s[-1]:  # arrived within this cycle
            break
        centre = robot.look().centre_of_mass()[0]
        planned = [np.interp(robot.time_s, certificate.time_s, c) for c in certificate.pose[:, :2].T]
        off.append(float(np.hypot(*(centre - planned))))
    assert len(off) >= len(plan.gaits) - 1
    assert max(off) < 1e-4 < certificate.clearance_m


def test_a_soft_robot_drives_its_plan(soft_problem):
    driven = execute(soft_problem, solve_with_lattice(soft_problem).plan)
    assert driven.reached and driven.collisions == 0


def test_soft_robots_under_a_rigid_plan_seldom_touch(problem_in):
    """The rigid driver foresees other friction, not other bodies: 3 of 75 drives in such corridors touch."""
    drives = []
    for length_m in (1.6, 2.0, 2.4):
        problem = problem_in(corridor(0.3, length_m))
        plan = solve_with_lattice(problem).plan
        drives += [execute(problem, plan, soft(stiffness)) for stiffness in (0.02, 0.005, 0.002)]
    assert sum(driven.collisions for driven in drives) <= 1
    assert sum(driven.reached for driven in drives) >= 7


def test_a_soft_robot_under_the_rigid_plan_of_the_first_maze_arrives():
    """benchmarks/soft_drives.py has the other stiffnesses, and the plans made for the soft robot itself."""
    robot = wpi_srs()
    problem = planning_problem(robot, placed_maze(robot, FIRST, 0.005), shipped_table())
    driven = execute(problem, solve_with_lattice(problem).plan, soft(0.005))
    assert driven.reached and driven.collisions == 0


@pytest.mark.parametrize("stiffness", [None, 0.02, 0.002])
def test_other_robots_under_a_soft_plan_never_touch(soft_problem, stiffness):
    other = wpi_srs() if stiffness is None else soft(stiffness)
    driven = execute(soft_problem, solve_with_lattice(soft_problem).plan, other)
    assert driven.collisions == 0
    assert driven.reached or driven.reason.startswith("stopped")


SD = 0.15
ENDS = (0.005 * np.exp(-2 * SD), 0.005 * np.exp(2 * SD))


@pytest.fixture(scope="module")
def unsure_problem(soft_problem):
    """The same robot, its stiffness known within a few per cent."""
    robot = soft(0.005).with_values(relative_sd={"bending_stiffness_n_m2": SD})
    deviation = cycle_deviation_m(robot, soft_problem.gaits)
    motion = dataclasses.replace(soft_problem.motion, deviation_m=deviation)
    return dataclasses.replace(soft_problem, robot=robot, motion=motion)


def test_a_cycle_may_be_off_by_what_the_stiffness_may_be_off(soft_problem, unsure_problem):
    """Simulated from rest on the softest and the stiffest body that it may be."""
    assert cycle_deviation_m(soft(0.005), soft_problem.gaits) is None
    index = [g.name for g in unsure_problem.gaits.gaits].index("fast")
    gait = unsure_problem.gaits.gaits[index].gait
    line = Timeline.of_gait(gait, 12 * gait.period_s)
    ways = []
    for stiffness in (0.005, *ENDS):
        run = Integrator(soft(stiffness))
        path = run.integrate(line, run.rest())
        last, _ = path.at(np.array([11 * gait.period_s, 12 * gait.period_s]))
        ways.append(np.hypot(*(last[1] - last[0])[:2]))
    off = max(abs(way - ways[0]) for way in ways)
    assert unsure_problem.motion.deviation_m[index] == pytest.approx(off, rel=0.05)


def test_the_stiffness_deviation_is_room_that_plans_and_looks_keep(soft_problem, unsure_problem):
    sure, unsure = (solve_with_lattice(p).plan for p in (soft_problem, unsure_problem))
    tube = unsure_problem.motion.deviation_m[list(unsure.gaits)]
    assert unsure.certificate.passed and unsure.certificate.clearance_m > 0.005
    assert tube.min() > 0.001
    at_the_end = unsure_problem.bending.tube_m(unsure.certificate.pose[-20:], unsure.gaits[-1])
    assert at_the_end[-1] == pytest.approx(tube[-1])
    known, open_loop = looks(soft_problem, sure), looks(unsure_problem, sure)
    assert open_loop.open_loop_m < known.open_loop_m
    assert open_loop.closed_loop_m < known.closed_loop_m


def test_the_driver_suspects_the_ends_of_the_stiffness_interval(unsure_problem):
    suspects = _yielding(unsure_problem.robot)
    assert [s.bending_stiffness_n_m2 for s in suspects] == pytest.approx(ENDS)
    plan = solve_with_lattice(unsure_problem).plan
    for stiffness in ENDS:
        driven = execute(unsure_problem, plan, soft(stiffness))
        assert driven.collisions == 0 and driven.reached


def test_states_are_carried_between_models(soft_problem, problem_in):
    run, rigid = soft_problem.integrator, problem_in(corridor(0.3, 2.0))
    gait = soft_problem.gaits.gaits[0].gait
    state = run.integrate(Timeline.of_gait(gait, 3.2 * gait.period_s), run.rest()).final
    adopted = rigid.as_planned(state, run)
    assert adopted.shape == (rigid.integrator.states,)
    np.testing.assert_array_equal(adopted[rigid.integrator.layout.kappa], state[run.layout.actuator][:4])
    back = soft_problem.as_planned(adopted, rigid.integrator)
    np.testing.assert_array_equal(back[run.layout.kappa], adopted[rigid.integrator.layout.kappa])
    np.testing.assert_array_equal(back[run.layout.actuator][:8], state[run.layout.actuator][:8])
    np.testing.assert_array_equal(soft_problem.as_planned(state)[7:], state[7:])

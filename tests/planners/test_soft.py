"""Planning and driving for bodies that bend; soft robots under rigid plans."""

import numpy as np
import pytest
from planner_rooms import corridor

from planners.drive.execute import execute
from planners.motion.transitions import motion_table, simulate_transitions
from planners.plan.solve import solve_with_lattice
from planners.search.problem import Problem
from srs_opt.gait_opt.replayed import replayed
from srs_opt.robot import wpi_srs
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.timeline import Timeline
from virtual_lab.live import LiveRobot
from virtual_lab.truth import Parameters, Truth


def soft(stiffness):
    return wpi_srs().with_values(bending_stiffness_n_m2=stiffness)


@pytest.fixture(scope="module")
def soft_problem(gaits):
    robot = soft(0.005)
    table = replayed(robot, gaits)
    motion = motion_table(robot, table, simulate_transitions(robot, table))
    return Problem(robot, table, motion, corridor(0.3, 2.0), 0.005)


def test_the_table_is_replayed_on_the_soft_body(gaits, soft_problem):
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


@pytest.mark.parametrize("stiffness", [None, 0.02, 0.002])
def test_other_robots_under_a_soft_plan_never_touch(soft_problem, stiffness):
    other = wpi_srs() if stiffness is None else soft(stiffness)
    driven = execute(soft_problem, solve_with_lattice(soft_problem).plan, other)
    assert driven.collisions == 0
    assert driven.reached or driven.reason.startswith("stopped")


def test_states_are_carried_between_models(soft_problem, problem_in):
    run, rigid = soft_problem.integrator, problem_in(corridor(0.3, 2.0))
    gait = soft_problem.gaits.gaits[0].gait
    state = run.integrate(Timeline.of_gait(gait, 3.2 * gait.period_s), run.rest()).final
    adopted = rigid.as_planned(state, run)
    assert adopted.shape == (rigid.run.states,)
    np.testing.assert_array_equal(adopted[rigid.run.layout.kappa], state[run.layout.actuator][:4])
    back = soft_problem.as_planned(adopted, rigid.run)
    np.testing.assert_array_equal(back[run.layout.kappa], adopted[rigid.run.layout.kappa])
    np.testing.assert_array_equal(back[run.layout.actuator][:8], state[run.layout.actuator][:8])
    np.testing.assert_array_equal(soft_problem.as_planned(state)[7:], state[7:])

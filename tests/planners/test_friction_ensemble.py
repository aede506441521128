"""What the driver foresees, and what it learns of friction on the way."""

import pytest
from planner_rooms import corridor

from planners.drive.friction_ensemble import DEFAULT_ENSEMBLE, FrictionEnsemble
from planners.motion.robots import undelayed, with_friction_times
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.timeline import Timeline


def driven(problem, true_robot, cycles=4):
    """Return the ensemble after some cycles of the fast gait on another robot, the cycle and the state."""
    ensemble = FrictionEnsemble(problem)
    run = Integrator(undelayed(true_robot), "complex")
    gait = problem.gaits["fast"].gait
    cycle = Timeline.of_gait(gait, gait.period_s)
    state = run.rest(problem.start.x, problem.start.y, problem.start.heading)
    for _ in range(cycles):
        before, state = state, run.integrate(cycle, state).final
        ensemble.learn(problem.as_planned(before), cycle, problem.as_planned(state))
    return ensemble, cycle, problem.as_planned(state)


def test_unknown_friction_is_any(problem_in):
    problem = problem_in(corridor(0.2, 3.0))
    ensemble = FrictionEnsemble(problem)
    gait = problem.gaits["fast"].gait
    ahead = Timeline.of_gait(gait, 3 * gait.period_s)
    start = problem.start
    state = problem.integrator.rest(start.x, start.y + 0.02, 0.15)
    rooms = [ensemble.room_m(state, ahead, k) for k in range(len(DEFAULT_ENSEMBLE.frictions))]
    assert max(rooms) - min(rooms) > 1e-4
    assert ensemble.least_room_m(state, ahead) == pytest.approx(min(rooms), abs=1e-12)


def test_the_planned_robot_is_recognized(problem_in, robot):
    ensemble, cycle, state = driven(problem_in(corridor(0.3, 3.0)), robot)
    assert ensemble.likely == (1.0, 1.0)
    assert ensemble.least_room_m(state, cycle) == ensemble.room_m(state, cycle)


@pytest.mark.parametrize(("along", "across"), [(0.8, 0.8), (1.2, 1.2), (1.5, 1.0)])
def test_other_friction_is_recognized(problem_in, robot, along, across):
    other = with_friction_times(robot, along, across)
    assert driven(problem_in(corridor(0.3, 3.0)), other)[0].likely == (along, across)


def test_a_hose_is_felt_along_the_wheels(problem_in, robot):
    hosed = robot.with_values(effects=[{"name": "tether_drag", "force_n": 0.05}])
    along, across = driven(problem_in(corridor(0.3, 3.0)), hosed)[0].likely
    assert along > 1 and across == 1

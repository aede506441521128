"""Coming to rest: the vented robot rolls out as a sledge does; near a wall a brake leaves more room."""

import numpy as np
import pytest
from planner_rooms import maze_of

from planners.drive.friction_ensemble import DEFAULT_ENSEMBLE, FrictionEnsemble
from planners.drive.halt import halt
from srs_opt.simulate.timeline import Timeline

SPEED_M_S = 0.4


@pytest.fixture(scope="module")
def before_wall(problem_in, robot):
    """Return a problem and the state of a robot that rolls towards a wall `ahead_m` from its nose."""

    def build(ahead_m):
        length = 1.0 + robot.length_m / 2 + ahead_m
        problem = problem_in(maze_of((0, 0, length, 0.6), (0.4, 0.3, 0.0), (0.6, 0.3, 0.05), []))
        state = problem.integrator.rest(1.0, 0.3, 0.0)
        state[3] = SPEED_M_S
        return problem, state

    return build


def vented(problem):
    return Timeline.vent(problem.robot.segments, DEFAULT_ENSEMBLE.coast_s, 0.0)


def test_vented_it_rolls_as_far_as_friction_lets_it(before_wall, robot):
    rolls_m = SPEED_M_S**2 / (2 * robot.friction_tangential * 9.81)
    left_m = 0.02
    problem, state = before_wall(rolls_m + left_m)
    assert FrictionEnsemble(problem).room_m(state, vented(problem)) == pytest.approx(left_m, abs=0.002)


def test_vents_at_once_where_there_is_room(before_wall):
    problem, state = before_wall(0.5)
    assert not halt(FrictionEnsemble(problem), state, problem.motion.rest).valve.any()


def test_brakes_where_venting_would_touch(before_wall):
    problem, state = before_wall(0.15)
    assert FrictionEnsemble(problem).room_m(state, vented(problem)) <= 0
    chosen = halt(FrictionEnsemble(problem), state, problem.motion.rest)
    assert chosen.valve.any() and FrictionEnsemble(problem).room_m(state, chosen) > 0
    assert not chosen.valve[:, -1].any() and np.isclose(chosen.duration_s[-1], DEFAULT_ENSEMBLE.coast_s)

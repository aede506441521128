"""What is said to hold between looks holds for starts drawn at random within the tolerance."""

import numpy as np
import pytest
from planner_rooms import corridor

from planners.plan.looks import Tolerance, looks
from planners.plan.solve import solve_with_lattice
from planners.search.tree import arrival_index, at_rest
from srs_opt.geometry import points_in_room
from srs_opt.simulate.shapes import centre_lines


@pytest.fixture(scope="module")
def solved(problem_in):
    problem = problem_in(corridor(0.16, 2.0))
    return problem, solve_with_lattice(problem).plan


def moved(state, rng, t, speed=True):
    state = state.copy()
    angle, far = rng.uniform(0, 2 * np.pi), t.position_m * np.sqrt(rng.uniform())
    state[:2] += far * np.cos(angle), far * np.sin(angle)
    state[2] += t.heading_rad * rng.choice([-1, 1])
    state[3] += t.speed_m_s * rng.choice([-1, 1]) * speed
    return state


def room_of(problem, trajectory):
    lines = points_in_room(centre_lines(problem.integrator, trajectory.kappa), trajectory.pose)
    arrived = arrival_index(problem.goal, trajectory.pose)
    return float(problem.body.exact(lines[: None if arrived is None else arrived + 1]).min())


def test_every_cycle_keeps_clear_from_wherever_a_look_may_find_it(solved):
    problem, plan = solved
    found = looks(problem, plan)
    rng, root = np.random.default_rng(3), at_rest(problem)
    least, before = np.inf, root.gait
    for k, (gait, state) in enumerate(zip(plan.gaits, [root.state, *plan.certificate.states])):
        timeline = problem.joints.timeline(before, gait)
        for _ in range(6):
            begun = moved(state, rng, found.tolerance, speed=k > 0)
            least = min(least, room_of(problem, problem.integrator.integrate(timeline, begun)))
        before = gait
    assert found.closed_loop_m - 2e-4 < least < found.closed_loop_m + 0.003


def test_without_looks_a_heading_moves_the_far_end(solved):
    problem, plan = solved
    rough = Tolerance(0.002, 0.01, 0.0)
    found = looks(problem, plan, rough)
    rng, root, least = np.random.default_rng(4), at_rest(problem), np.inf
    for _ in range(8):
        state, before = moved(root.state, rng, rough), root.gait
        for gait in plan.gaits:
            trajectory = problem.integrator.integrate(problem.joints.timeline(before, gait), state)
            least = min(least, room_of(problem, trajectory))
            state, before = trajectory.final, gait
    assert least >= found.open_loop_m - 2e-4
    assert looks(problem, plan, Tolerance(0.001, 0.2, 0.0)).needs_looks


def test_a_long_plan_must_be_driven_closed_loop(problem_in):
    problem = problem_in(corridor(0.16, 12.0))
    plan = solve_with_lattice(problem).plan
    found = looks(problem, plan)
    assert plan.certificate.passed and found.needs_looks and found.closed_loop_m > 0
    assert 1.0 < found.open_until_m < plan.length_m
    assert "closed-loop" in found.in_words()

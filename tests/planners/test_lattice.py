from dataclasses import replace

import numpy as np
import pytest
import shapely
from planner_rooms import corridor, gate, maze_of

from planners.plan.certify import Certifier, certify
from planners.plan.settings import PLAN_CERTIFICATE
from planners.plan.solve import LatticeSolver, solve_with_lattice
from planners.search.beam import BeamSettings
from planners.search.clearance import BodyClearance
from planners.search.lattice import LatticeSearch, LatticeSettings
from srs_opt.simulate.timeline import Timeline


def test_corridor_is_solved_and_certified(problem_in):
    problem = problem_in(corridor(0.3))
    result = solve_with_lattice(problem)
    assert result.status == "solved" and result.plan is not None
    certificate = result.plan.certificate
    assert certificate.passed
    assert problem.goal.reached(*map(float, certificate.pose[-1]))
    assert certificate.clearance_m >= problem.margin_m - 1e-6
    # an oracle of its own: shapely bodies against the room
    room = shapely.box(*problem.maze.bounds)
    bodies = shapely.buffer(shapely.linestrings(certificate.lines[::25]), 0.02)
    assert all(room.contains(body) for body in bodies)


def test_same_question_same_answer(problem_in):
    first = solve_with_lattice(problem_in(corridor(0.3))).plan
    again = solve_with_lattice(problem_in(corridor(0.3))).plan
    assert first.gaits == again.gaits
    assert np.array_equal(first.certificate.pose, again.certificate.pose)


def test_slim_gait_where_it_is_narrow(problem_in, gaits):
    fast = next(g for g in gaits.gaits if g.name == "fast")
    slim = next(g for g in gaits.gaits if g.name == "slim")
    width = 0.5 * (sum(fast.envelope_m) + sum(slim.envelope_m)) + 0.01
    walls = [(0.9, 0.0, 1.7, 0.3 - width / 2), (0.9, 0.3 + width / 2, 1.7, 0.6)]
    maze = maze_of((0, 0, 2.6, 0.6), (0.25, 0.3, 0.0), (2.3, 0.3, 0.08), walls)
    result = solve_with_lattice(problem_in(maze))
    assert result.status == "solved"
    names = {gaits.gaits[g].name for g in result.plan.gaits}
    assert "slim" in names


def test_backs_out_of_a_dead_end(problem_in):
    """The start faces a wall; the goal is behind."""
    maze = maze_of((0, 0, 1.4, 0.16), (1.2, 0.08, 0.0), (0.4, 0.08, 0.08), [])
    result = solve_with_lattice(problem_in(maze))
    assert result.status == "solved"
    assert any(step["reverse"] for step in result.plan.steps(problem_in(maze)))


def test_gap_narrower_than_the_body_is_refused_quickly(problem_in):
    result = solve_with_lattice(problem_in(gate(0.045)))
    assert result.status == "infeasible"
    assert result.effort["simulated"] <= 500


def test_closed_room_is_exhausted_or_refused(problem_in):
    maze = maze_of((0, 0, 1.2, 0.1), (0.2, 0.05, 0.0), (1.0, 0.05, 0.05), [(0.5, 0.0, 0.52, 0.1)])
    result = solve_with_lattice(problem_in(maze))
    assert result.status == "infeasible"


def test_clock_is_only_a_guard(problem_in):
    result = solve_with_lattice(problem_in(corridor(0.3)), time_limit_s=1e-9)
    assert result.status in ("timeout", "solved")
    assert result.plan is not None or "time limit" in result.reason


def test_certificate_catches_a_planted_collision(problem_in):
    free = problem_in(corridor(0.3))
    plan = solve_with_lattice(free).plan
    where = plan.certificate.pose[len(plan.certificate.pose) // 2, :2]
    planted = corridor(0.3)
    pillar = shapely.Point(*where).buffer(0.01).bounds
    planted = maze_of(planted.bounds, (0.25, 0.15, 0.0), (1.3, 0.15, 0.08), [pillar])
    certificate = certify(problem_in(planted), plan.gaits)
    assert not certificate.passed
    assert certificate.failed_cycle is not None
    assert "wall" in certificate.reason


def test_certificate_catches_a_plan_that_ends_short(problem_in):
    problem = problem_in(corridor(0.3))
    plan = solve_with_lattice(problem).plan
    certificate = certify(problem, plan.gaits[:-2])
    assert not certificate.passed
    assert "short of the goal" in certificate.reason


def test_wider_margin_is_kept(problem_in):
    problem = problem_in(corridor(0.3), 0.02)
    result = solve_with_lattice(problem)
    assert result.status == "solved"
    assert result.plan.certificate.clearance_m >= 0.02 - 1e-6


def test_body_clearance_decides_as_exact_geometry(problem_in):
    problem = problem_in(gate(0.2))
    body: BodyClearance = problem.body
    rng = np.random.default_rng(0)
    start = rng.uniform([0.1, 0.1], [1.9, 0.5], (300, 2))
    angle = rng.uniform(-np.pi, np.pi, 300)
    step = np.linspace(-0.1, 0.1, 9)
    lines = start[:, None] + step[None, :, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)[:, None]
    exact = body.exact(lines)
    assert exact == pytest.approx(np.array([_oracle(problem.maze, line) for line in lines]), abs=1e-9)
    for line, room in zip(lines, exact):
        assert body.keeps_margin(line[None]) == (room >= problem.margin_m)


def _oracle(maze, line):
    """Distance of a capsule to boxes and bounds, by shapely alone."""
    shape = shapely.LineString(line)
    inside = shapely.box(*maze.bounds)
    if not inside.contains(shape):
        return -0.02
    walls = [shapely.box(*shapely.bounds(w)) for w in maze.walls.skeletons]
    return min([shape.distance(inside.exterior), *(shape.distance(w) for w in walls)]) - 0.02


def test_search_says_when_nothing_is_left(problem_in):
    maze = maze_of((0, 0, 0.5, 0.1), (0.25, 0.05, 0.0), (0.45, 0.05, 0.01), [])
    search = LatticeSearch(problem_in(maze), LatticeSettings())
    while not search.exhausted:
        assert search.advance(50) is None
    assert search.simulated < 3000


def test_beam_and_best_first_search_both_arrive(problem_in):
    problem = problem_in(corridor(0.3))
    for beams in ((BeamSettings(),), ()):
        plan = LatticeSolver(problem, beams=beams).run().plan
        assert plan is not None and plan.certificate.passed


def test_wider_beams_are_not_slower(problem_in):
    walls = [(0.7, 0.0, 0.9, 0.3), (1.4, 0.3, 1.6, 0.6)]
    problem = problem_in(maze_of((0, 0, 2.4, 0.6), (0.25, 0.3, 0.0), (2.1, 0.3, 0.08), walls))
    times = [
        LatticeSolver(problem, beams=(BeamSettings(width=width),)).run().plan.duration_s for width in (4, 100)
    ]
    assert times[1] <= times[0] + 0.1


def test_cycles_side_by_side_are_those_alone(problem_in):
    problem = problem_in(corridor(0.3))
    state = problem.integrator.rest(0.3, 0.15, 0.1)
    together = problem.simulate_all(
        [(state, problem.motion.rest, gait) for gait in range(problem.motion.size)]
    )
    for gait, cycle in enumerate(together):
        assert np.array_equal(cycle.state, problem.simulate(state, problem.motion.rest, gait).state)


def test_the_certificate_s_bound_covers_the_finer_integration_s_error(problem_in):
    """Errors with the least ratio, of one sign: their difference is all that the two integrations tell."""
    problem, finer_m = problem_in(corridor(0.3, 2.0)), 1e-4
    run, gait = problem.integrator, problem.gaits.gaits[0].gait
    true = run.integrate(Timeline.of_gait(gait, gait.period_s), run.rest())
    fine, coarse = (
        [replace(true, pose=true.pose + [off_m, 0.0, 0.0])]
        for off_m in (finer_m, PLAN_CERTIFICATE.error_ratio * finer_m)
    )
    _, error = Certifier(problem)._error_m(fine, coarse)
    assert error == pytest.approx(finer_m, rel=1e-6)

"""When there is no way: a proof, or nothing found; and ways that were missed once."""

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from planner_rooms import gate, maze_of

from planners.maze.places import Goal
from planners.maze.walls import Walls
from planners.plan.certify import certify
from planners.plan.explain import explain
from planners.plan.solve import RunSolver, solve_with_lattice


def wrapped(problem, gaits, room_m):
    """Return the maze of a corridor that keeps `room_m` from the body as it plays `gaits`."""
    c = certify(problem, gaits)
    assert not c.reason or "short" in c.reason
    straight = shapely.buffer(shapely.linestrings(c.lines[0]), 0.02 + room_m)
    bodies = [straight, *shapely.buffer(shapely.linestrings(c.lines), 0.02 + room_m)]
    free = shapely.union_all(bodies)
    box = tuple(float(v) for v in shapely.buffer(free, 0.02).bounds)
    solid = shapely.get_parts(shapely.box(*box) - free)
    end = c.pose[-1]
    return replace(
        problem.maze,
        bounds=box,
        walls=Walls.of([(part, 0.0) for part in solid]),
        goal=Goal(float(end[0]), float(end[1]), 0.03),
    )


def test_a_corridor_around_a_driven_gait_with_half_a_millimetre_to_spare(problem_in, gaits):
    open_floor = problem_in(maze_of((-2, -2, 4, 2), (0, 0, 0), (3.5, 1.5, 0.05), []))
    slim = [entry.name for entry in gaits.gaits].index("slim")
    maze = wrapped(open_floor, [slim] * 8, 0.0055)
    result = solve_with_lattice(problem_in(maze, 0.005))
    assert result.status == "solved"


def test_a_corridor_around_a_u_turn_with_half_a_millimetre_to_spare(problem_in, gaits):
    open_floor = problem_in(maze_of((-2, -2, 4, 2), (0, 0, 0), (3.5, 1.5, 0.05), []))
    names = [entry.name for entry in gaits.gaits]
    known = [names.index(name) for name in ("fast", "fast", *["tight left"] * 4, "fast", "fast")]
    problem = problem_in(wrapped(open_floor, known, 0.0055), 0.005)
    result = RunSolver(problem, time_limit_s=300.0).run(3000)  # a busy machine must not decide
    assert result.status == "solved" and result.plan.planner == "runs"
    assert result.plan.certificate.clearance_m >= 0.005


def test_goal_with_a_heading_in_an_open_box(problem_in):
    maze = maze_of((0, 0, 2, 1.2), (0.4, 0.6, 0.0), (1.5, 0.6, 0.05), [])
    maze = maze.with_places(goal=Goal(1.5, 0.6, 0.05, heading=math.pi, heading_tolerance=0.1))
    result = solve_with_lattice(problem_in(maze))
    assert result.status == "solved" and result.effort["simulated"] < 3000
    end = result.plan.certificate.pose[-1]
    assert abs(math.remainder(end[2] - math.pi, 2 * math.pi)) <= 0.1


def test_heading_map_knows_that_turning_round_takes_a_way(problem_in):
    maze = maze_of((0, 0, 2, 1.2), (0.4, 0.6, 0.0), (1.5, 0.6, 0.05), [])
    ahead, behind = (
        problem_in(maze.with_places(goal=Goal(1.5, 0.6, 0.05, heading=h, heading_tolerance=0.1)))
        for h in (0.0, math.pi)
    )
    here = np.array([[0.4, 0.6]]), np.array([0.0]), np.array([False])
    straight, turned = (float(p.to_goal_by_heading.at(*here)[0]) for p in (ahead, behind))
    shortest = float(ahead.to_goal.at(here[0])[0])
    assert straight == pytest.approx(shortest, rel=0.15)
    radius = min(abs(e.radius_m) for e in ahead.gaits.gaits if e.radius_m)
    assert turned > straight + 0.5 * math.pi * radius / ahead.cost_model.top_speed_m_s


def test_only_a_proof_is_called_infeasible(problem_in):
    assert solve_with_lattice(problem_in(gate(0.045))).status == "infeasible"  # narrower than the body
    box = maze_of((0, 0, 0.5, 0.1), (0.25, 0.05, 0), (0.45, 0.05, 0.01), [])
    result = solve_with_lattice(problem_in(box), time_limit_s=300.0)  # a busy machine must not decide
    assert result.status == "not_found" and "resolution" in result.reason


def test_a_start_that_breaks_the_margin_is_the_reason(problem_in):
    maze = maze_of((0, 0, 1.5, 1.0), (0.4, 0.0215, 0.0), (1.1, 0.5, 0.05), [])
    words = explain(problem_in(maze)).in_words("no plan")
    assert "The start breaks the margin" in words and "1.5 mm" in words
    assert "tightest" not in words

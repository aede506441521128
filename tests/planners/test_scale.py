"""A robot three times or a third as large, in a maze as much larger, gets the same plan.

Lengths times s, curvature per pressure over s, gravity and the friction's smoothing speed times s, inertia
times s^2: every equation of motion then holds with lengths times s and times unchanged.
"""

import numpy as np
import pytest
import shapely

from planners.maze.maze import Maze
from planners.maze.places import Goal, Pose
from planners.maze.walls import Walls
from planners.motion.transitions import motion_table, simulate_transitions
from planners.plan.looks import looks
from planners.plan.solve import solve_with_lattice
from planners.search.problem import Problem
from srs_opt.gait_opt.table import GaitTable, TableGait
from srs_opt.orbit.steady import steady_gait

NAMES = ("fast", "gentle left", "gentle right", "tight left", "tight right")
BOXES = [(1.0, 0.0, 1.02, 0.75), (1.55, 0.45, 1.57, 1.2)]


def scaled(robot, s):
    return robot.with_values(
        segment_length_m=s * robot.segment_length_m,
        gap_length_m=s * robot.gap_length_m,
        body_width_m=s * robot.body_width_m,
        link_inertia_kg_m2=s**2 * robot.link_inertia_kg_m2,
        friction_speed_m_s=s * robot.friction_speed_m_s,
        gravity_m_s2=s * robot.gravity_m_s2,
        curvature_per_pressure_1_m_kpa=robot.curvature_per_pressure_1_m_kpa / s,
    )


def plan(robot, gaits, s):
    large = scaled(robot, s)
    entries = [e for e in gaits.gaits if e.name in NAMES]
    entries = [TableGait.of_orbit(e.name, steady_gait(large, e.gait)) for e in entries]
    table = GaitTable(large.name, large.fingerprint(), "complex", tuple(entries))
    motion = motion_table(large, table, simulate_transitions(large, table))
    walls = Walls.of([(shapely.box(*(s * v for v in box)), 0.0) for box in BOXES])
    goal = Goal(2.0 * s, 0.4 * s, 0.08 * s)
    maze = Maze("z", (0, 0, 2.3 * s, 1.2 * s), walls, start=Pose(0.3 * s, 0.4 * s, 0.0), goal=goal)
    problem = Problem(large, table, motion, maze, 0.005 * s)
    return problem, solve_with_lattice(problem).plan


@pytest.fixture(scope="module")
def usual(robot, gaits):
    return plan(robot, gaits, 1.0)


@pytest.mark.parametrize("s", [3.0, 1 / 3])
def test_the_plan_does_not_depend_on_the_size(robot, gaits, usual, s):
    (problem, other), (usual_problem, usual) = plan(robot, gaits, s), usual
    assert other.gaits == usual.gaits
    assert other.duration_s == pytest.approx(usual.duration_s, rel=1e-3)
    assert other.length_m == pytest.approx(s * usual.length_m, rel=1e-3)
    assert other.certificate.clearance_m == pytest.approx(s * usual.certificate.clearance_m, rel=0.02)
    ends = (p.certificate.pose[-1] / (k, k, 1) for p, k in ((usual, 1.0), (other, s)))
    assert np.allclose(*ends, atol=2e-3)
    looked, usually = looks(problem, other), looks(usual_problem, usual)
    assert looked.closed_loop_m == pytest.approx(s * usually.closed_loop_m, rel=0.02)
    assert looked.open_loop_m == pytest.approx(s * usually.open_loop_m, rel=0.02)

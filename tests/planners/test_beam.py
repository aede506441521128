"""The beam, and what it takes for nearness to the goal."""

import numpy as np
from planner_rooms import maze_of

from planners.plan.solve import LatticeSolver
from planners.search.beam import BEAM
from planners.search.heuristic import cost_to_go
from planners.search.settings import HEURISTIC

THIN_M = 0.006


def serpentine(lanes):
    """Return lanes of 0.4 m with thin walls between; the way back and forth is long."""
    walls = []
    for k in range(1, lanes):
        begin = 0.0 if k % 2 else 0.4
        walls.append((begin, 0.4 * k, begin + 2.0, 0.4 * k + THIN_M))
    return maze_of((0, 0, 2.4, 0.4 * lanes), (0.3, 0.2, 0.0), (1.2, 0.4 * lanes - 0.2, 0.1), walls)


def test_a_head_across_a_wall_promises_little(problem_in):
    problem = problem_in(serpentine(3))
    here = np.array([0.8, 0.34, np.pi / 2])
    middle = float(problem.to_goal.at(here[:2]))
    head = float(problem.to_goal.at(here[:2] + [0.0, problem.robot.length_m / 2]))
    gain = HEURISTIC.most_gain * problem.robot.length_m / 2 / problem.cost_model.top_speed_m_s
    assert head < middle - 1.5 * gain, "the head is across the wall, far on the way"
    gaits = problem.motion.size
    ends = np.tile(here, (gaits, 1))
    ends[:, 2] -= problem.motion.course[:-1]
    left = cost_to_go(problem, ends, np.full(gaits, problem.cost_model.top_speed_m_s))
    assert np.all(left > middle - gain)


def test_the_beam_comes_through_lanes_with_thin_walls(problem_in):
    told = []
    result = LatticeSolver(problem_in(serpentine(4)), beams=(BEAM,), tell=told.append).run()
    assert result.status == "solved"
    assert not any("no plan in this beam" in line for line in told)

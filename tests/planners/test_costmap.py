import numpy as np
import pytest
from planner_rooms import corridor, maze_of

from planners.search.costmap import BLOCKED_S, speed_by_room


def test_time_falls_towards_the_goal(problem_in):
    problem = problem_in(corridor(0.3))
    x = np.linspace(0.1, 1.2, 40)
    seconds = problem.to_goal.at(np.stack([x, np.full(40, 0.15)], axis=1))
    assert np.all(np.diff(seconds) < 1e-9)
    fastest = max(abs(g.speed_m_s) for g in problem.gaits.gaits)
    assert seconds[0] >= (1.2 - 0.1) / fastest * 0.95


def test_thin_walls_are_not_jumped(problem_in):
    """A wall of 1 mm divides the room but for an opening at the top."""
    maze = maze_of((0, 0, 3, 3), (0.5, 0.5, 0), (2.5, 0.5, 0.1), [(1.5, 0, 1.501, 2.6)])
    to_goal = problem_in(maze).to_goal
    left, right = (float(to_goal.at(np.array(p))) for p in ((1.3, 0.5), (1.7, 0.5)))
    assert left > right + 2 * (2.6 - 0.5) / 0.7


def test_walled_off_places_are_blocked(problem_in):
    maze = maze_of((0, 0, 2, 1), (0.5, 0.5, 0), (0.9, 0.5, 0.1), [(1.4, 0, 1.5, 1)])
    assert problem_in(maze).to_goal.at(np.array([1.8, 0.5])) == BLOCKED_S


def test_more_room_more_speed(gaits):
    reach, speed = speed_by_room(gaits)
    assert np.all(np.diff(reach) >= 0) and np.all(np.diff(speed) >= 0)
    assert speed[-1] == pytest.approx(max(abs(g.speed_m_s) for g in gaits.gaits))

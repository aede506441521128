"""What is wrong with a start or a goal, said at once and in one line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import shapely

from planners.maze.maze import Maze
from planners.maze.places import Goal, Pose, RobotSize
from srs_opt.errors import InputError


@dataclass(frozen=True)
class PlacementProblem:
    """Why the start or the goal is impossible.

    Attributes
    ----------
    place : {"start", "goal"}
    kind : {"missing", "outside", "wall", "body"}
        Not given; outside the bounds; centre in a wall; the straight body meets a wall.
    message : str
        One line: file, what, where, what to try.
    """

    place: Literal["start", "goal"]
    kind: Literal["missing", "outside", "wall", "body"]
    message: str


def placement_problem(maze: Maze, size: RobotSize | None = None) -> PlacementProblem | None:
    """Return the first thing wrong with start or goal, or None.

    With `size`, the straight robot (without its margin) must fit at the start too.
    """
    return _start_problem(maze, size) or _goal_problem(maze)


def check_placement(maze: Maze, size: RobotSize | None = None) -> tuple[Pose, Goal]:
    """Return start and goal.

    Raises
    ------
    InputError
        If one is missing, outside the bounds or in a wall, in one line.
    """
    problem = placement_problem(maze, size)
    if problem is not None:
        raise InputError(problem.message)
    assert maze.start is not None and maze.goal is not None  # placement_problem has seen to it
    return maze.start, maze.goal


def _start_problem(maze: Maze, size: RobotSize | None) -> PlacementProblem | None:
    start = maze.start
    if start is None:
        message = (
            f"{maze.source}: no start: this format has none; give one with --start X,Y,HEADING (m, m, rad)"
        )
        return PlacementProblem("start", "missing", message)
    where = f"{maze.source}: start ({start.x:g}, {start.y:g})"
    if not maze.inside_bounds(start.x, start.y):
        return PlacementProblem(
            "start", "outside", f"{where} is outside the bounds {_bounds(maze)}; move it inside"
        )
    if maze.clearance(shapely.Point(start.x, start.y)) <= 0:
        return PlacementProblem("start", "wall", f"{where} is inside a wall; move it to a free place")
    if size is not None and maze.clearance(size.straight_body(start)) <= 0:
        message = (
            f"{where}: the straight robot ({size.length_m:.3g} m long, {2 * size.half_width_m:.3g} m wide) "
            f"touches a wall there with heading {start.heading:.3g} rad; move or turn it"
        )
        return PlacementProblem("start", "body", message)
    return None


def _goal_problem(maze: Maze) -> PlacementProblem | None:
    goal = maze.goal
    if goal is None:
        message = f"{maze.source}: no goal: this format has none; give one with --goal X,Y[,RADIUS] (m)"
        return PlacementProblem("goal", "missing", message)
    where = f"{maze.source}: goal ({goal.x:g}, {goal.y:g})"
    if goal.boxes:  # cells: a free spot in one of them is enough
        spots = [((a + c) / 2, (b + d) / 2) for a, b, c, d in goal.boxes]
        if maze.point_clearances(spots).max() <= 0:
            return PlacementProblem("goal", "wall", f"{where}: all goal cells are inside walls; open one")
        return None
    if not maze.inside_bounds(goal.x, goal.y):
        return PlacementProblem(
            "goal", "outside", f"{where} is outside the bounds {_bounds(maze)}; move it inside"
        )
    if maze.clearance(shapely.Point(goal.x, goal.y)) <= 0:
        return PlacementProblem("goal", "wall", f"{where} is inside a wall; move it to a free place")
    return None


def _bounds(maze: Maze) -> str:
    return "[" + ", ".join(f"{value:g}" for value in maze.bounds) + "]"

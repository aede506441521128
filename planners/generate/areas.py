"""Mazes that are areas: rooms with doors, and two chambers joined by one narrow passage."""

from __future__ import annotations

import random

import shapely

from planners.maze.maze import Maze
from planners.maze.places import Goal, Pose, RobotSize
from planners.maze.walls import Walls, box_shape


def rooms(
    size: int, cell_m: float, wall_m: float, door_m: float, rng: random.Random, robot: RobotSize
) -> Maze:
    """Return a square area of `size` cells a side, divided into rooms, every wall with one door.

    Walls run on lines between cells and doors sit in the middle of a cell's side, so no wall ever
    ends in a door and every room can be reached (by whatever fits through the doors).

    Parameters
    ----------
    size : int
        Side of the area in cells.
    cell_m, wall_m, door_m : float
        Cell size, wall thickness and door width in metres.
    rng : random.Random
    robot : RobotSize
        Placed in the lower left corner.
    """
    segments: list[tuple[tuple[float, float], tuple[float, float]]] = []
    smallest = max(2, size // 4)
    areas = [(0, 0, size, size)]
    while areas:
        x0, y0, x1, y1 = areas.pop()
        wide, high = x1 - x0, y1 - y0
        if max(wide, high) < 2 * smallest:
            continue
        upright = wide > high or (wide == high and rng.random() < 0.5)
        low, end = (x0, x1) if upright else (y0, y1)
        line = rng.randint(low + smallest, end - smallest)
        side, stop = (y0, y1) if upright else (x0, x1)
        door = (rng.randrange(side, stop) + 0.5) * cell_m
        for a, b in ((side * cell_m, door - door_m / 2), (door + door_m / 2, stop * cell_m)):
            segments.append(
                ((line * cell_m, a), (line * cell_m, b))
                if upright
                else ((a, line * cell_m), (b, line * cell_m))
            )
        areas += (
            [(x0, y0, line, y1), (line, y0, x1, y1)] if upright else [(x0, y0, x1, line), (x0, line, x1, y1)]
        )
    half = wall_m / 2
    boxes = [(min(a[0], b[0]), min(a[1], b[1]), max(a[0], b[0]), max(a[1], b[1])) for a, b in segments]
    # thick across the wall only, so that a door keeps its width
    shapes = [
        box_shape(
            (x0 - half * (x0 == x1), y0 - half * (y0 == y1), x1 + half * (x0 == x1), y1 + half * (y0 == y1))
        )
        for x0, y0, x1, y1 in boxes
    ]
    side_m = size * cell_m
    start = Pose(max(cell_m / 2, robot.margin_m + robot.length_m / 2), cell_m / 2, 0.0)
    goal = Goal(side_m - cell_m / 2, side_m - cell_m / 2, radius=cell_m / 4)
    return Maze("rooms", (0.0, 0.0, side_m, side_m), Walls.of(shapes), start=start, goal=goal)


def corridor(cell_m: float, width_m: float, length_m: float, rng: random.Random, robot: RobotSize) -> Maze:
    """Return two chambers joined by a straight passage, its place across drawn at random.

    Parameters
    ----------
    cell_m : float
        Half the height of a chamber in metres.
    width_m, length_m : float
        Of the passage, in metres.
    rng : random.Random
    robot : RobotSize
        Placed in the left chamber, heading right.
    """
    chamber, height = max(2 * cell_m, 2 * robot.length_m), max(2 * cell_m, 1.5 * width_m)
    middle = height / 2 + rng.uniform(-1, 1) * (height - width_m) / 4
    total = 2 * chamber + length_m
    left, right = chamber, chamber + length_m
    shapes = [
        (shapely.box(left, 0.0, right, middle - width_m / 2), 0.0),
        (shapely.box(left, middle + width_m / 2, right, height), 0.0),
    ]
    start = Pose(robot.margin_m + robot.length_m / 2 + 0.25 * robot.length_m, height / 2, 0.0)
    goal = Goal(total - chamber / 3, height / 2, radius=chamber / 8)
    return Maze("corridor", (0.0, 0.0, total, height), Walls.of(shapes), start=start, goal=goal)

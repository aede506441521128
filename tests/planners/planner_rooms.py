"""Mazes made on the spot."""

from __future__ import annotations

import shapely

from planners.maze.maze import Maze
from planners.maze.places import Box, Goal, Pose
from planners.maze.walls import Walls


def maze_of(
    bounds: Box, start: tuple[float, float, float], goal: tuple[float, float, float], walls: list[Box]
) -> Maze:
    """Return a maze of boxes."""
    shapes = [(shapely.box(*wall), 0.0) for wall in walls]
    return Maze("test", bounds, Walls.of(shapes), start=Pose(*start), goal=Goal(*goal))


def corridor(width: float, length: float = 1.6) -> Maze:
    """Return a straight corridor, start at the left, goal at the right."""
    middle = width / 2
    return maze_of((0, 0, length, width), (0.25, middle, 0.0), (length - 0.3, middle, 0.08), [])


def gate(width: float) -> Maze:
    """Return two rooms with a gap of `width` in the wall between them."""
    low, high = 0.3 - width / 2, 0.3 + width / 2
    walls = [(0.99, 0.0, 1.01, low), (0.99, high, 1.01, 0.6)]
    return maze_of((0, 0, 2.0, 0.6), (0.25, 0.3, 0.0), (1.7, 0.3, 0.08), walls)

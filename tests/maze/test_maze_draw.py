"""Drawing: walls where they are, at the right places of the axes."""

import math

import matplotlib
import numpy as np
import pytest
import shapely

from planners.maze.draw import draw_maze
from planners.maze.maze import Maze
from planners.maze.places import Goal, Pose
from planners.maze.raster import Raster
from planners.maze.walls import Walls

matplotlib.use("Agg")


def picture(maze: Maze, places: bool = False):
    """Return a function that tells whether the picture is dark at a point of the maze."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 6), dpi=100)
    draw_maze(axes, maze, places=places)
    figure.canvas.draw()
    pixels = np.asarray(figure.canvas.buffer_rgba())
    transform, height = axes.transData, pixels.shape[0]
    plt.close(figure)

    def dark(x: float, y: float) -> bool:
        column, row = transform.transform((x, y))
        return bool(pixels[int(height - row), int(column), :3].max() < 100)

    return dark


def test_vector_walls_are_drawn_in_place():
    ring = shapely.Polygon(
        [(1, 1), (2, 1), (2, 2), (1, 2)], [[(1.3, 1.3), (1.7, 1.3), (1.7, 1.7), (1.3, 1.7)]]
    )
    dark = picture(Maze("m", (0, 0, 4, 3), Walls.of([(ring, 0.0), (shapely.Point(3, 1), 0.4)])))
    assert dark(1.15, 1.5) and dark(3.2, 1.1)
    assert not dark(1.5, 1.5)  # the hole
    assert not dark(3.4, 1.4)
    assert not dark(0.5, 2.5)


@pytest.mark.parametrize("turn", [0.0, 0.6])
def test_cells_are_drawn_in_place(turn):
    occupied = np.zeros((4, 6), dtype=bool)
    occupied[1, 4] = True
    raster = Raster(occupied, 0.5, Pose(1.0, 1.0, turn))
    maze = Maze("m", raster.bounds(), raster=raster)
    dark = picture(maze)
    for column in range(6):
        for row in range(4):
            x, y = raster.to_world(np.array([0.5 * column + 0.25, 0.5 * row + 0.25]))
            assert dark(x, y) == (column == 4 and row == 1)


def test_places_are_drawn():
    maze = Maze("m", (0, 0, 4, 3), start=Pose(1, 1, math.pi / 2), goal=Goal(3, 2, 0.2, heading=1.0))
    picture(maze, places=True)
    picture(maze.with_places(goal=Goal.of_boxes(((2, 2, 3, 3), (3, 2, 4, 3)))), places=True)

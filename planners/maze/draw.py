"""A maze on paper: walls dark grey, unknown cells light brown, start an arrow, goal a green region."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from planners.maze.maze import Maze
from planners.maze.places import Goal, Pose
from planners.maze.raster import Raster

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WALL = "#3a3a3a"
UNKNOWN = "#b9b4a6"
START = "#1f5fa8"
GOAL = "#2e8b57"
RIM = 0.012
"""Width of the drawn rim of wall about the bounds, over the maze's larger side."""
ARROW_M = 0.05
MAX_PIXELS = 1500
"""Occupancy grids are thinned to this many cells a side for drawing (occupied if any is)."""


def draw_maze(axes: Axes, maze: Maze, *, places: bool = True) -> None:
    """Draw `maze` to scale on matplotlib `axes`, in metres.

    Parameters
    ----------
    axes : matplotlib Axes
    maze : Maze
    places : bool
        Whether to mark start and goal.
    """
    xmin, ymin, xmax, ymax = maze.bounds
    rim = RIM * max(maze.width_m, maze.height_m)
    axes.set_aspect("equal")
    axes.set_xlim(xmin - rim, xmax + rim)
    axes.set_ylim(ymin - rim, ymax + rim)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    for side in axes.spines.values():
        side.set_visible(False)
    frame = shapely.box(xmin - rim, ymin - rim, xmax + rim, ymax + rim) - shapely.box(*maze.bounds)
    _fill(axes, frame)
    if maze.raster is not None:
        _draw_raster(axes, maze)
    if len(maze.walls):
        _fill(axes, maze.walls.union & shapely.box(*maze.bounds))
    if places and maze.goal is not None:
        _draw_goal(axes, maze.goal)
    if places and maze.start is not None:
        _draw_start(axes, maze.start, max(maze.width_m, maze.height_m))


def _fill(axes: Axes, region: shapely.Geometry) -> None:
    """Fill a region with holes as one path."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    rings = [
        Path(np.asarray(ring.coords), closed=True)
        for part in shapely.get_parts(region)
        if part.geom_type == "Polygon"
        for ring in (part.exterior, *part.interiors)
    ]
    if rings:
        axes.add_patch(PathPatch(Path.make_compound_path(*rings), facecolor=WALL, edgecolor="none", zorder=2))


def _draw_raster(axes: Axes, maze: Maze) -> None:
    raster = maze.raster
    assert raster is not None  # the caller has looked
    if raster.unknown is None:
        _draw_cells(axes, raster, raster.occupied, WALL)
    else:
        _draw_cells(axes, raster, raster.occupied & ~raster.unknown, WALL)
        _draw_cells(axes, raster, raster.unknown, UNKNOWN)
        taken = "wall" if (raster.occupied & raster.unknown).any() else "free"
        axes.scatter([], [], marker="s", color=UNKNOWN, label=f"unknown, taken for {taken}")
    rim = RIM * max(maze.width_m, maze.height_m)  # imshow has moved the limits
    axes.set_xlim(maze.bounds[0] - rim, maze.bounds[2] + rim)
    axes.set_ylim(maze.bounds[1] - rim, maze.bounds[3] + rim)


def _draw_cells(axes: Axes, raster: Raster, cells: NDArray[np.bool_], color: str) -> None:
    from matplotlib.colors import to_rgba_array
    from matplotlib.transforms import Affine2D

    thin = max(1, math.ceil(max(cells.shape) / MAX_PIXELS))
    rows, columns = cells.shape
    cells = np.pad(cells, ((0, -rows % thin), (0, -columns % thin)))
    pools = cells.reshape(cells.shape[0] // thin, thin, -1, thin)
    cells = np.asarray(pools.any(axis=(1, 3)))
    step = raster.cell_m * thin
    turned = Affine2D().rotate(raster.origin.heading).translate(raster.origin.x, raster.origin.y)
    # bytes of colour: numbers with a colour map take 300 MB more for 2000 x 2000 cells
    image = np.zeros((*cells.shape, 4), dtype=np.uint8)
    image[cells] = np.round(255 * to_rgba_array(color)[0])
    axes.imshow(
        image,
        origin="lower",
        extent=(0.0, cells.shape[1] * step, 0.0, cells.shape[0] * step),
        transform=turned + axes.transData,
        interpolation="nearest",
        zorder=2,
        aspect="equal",
    )


def _draw_goal(axes: Axes, goal: Goal) -> None:
    from matplotlib.patches import Circle, Rectangle

    style: dict[str, Any] = {
        "facecolor": GOAL,
        "edgecolor": GOAL,
        "alpha": 0.35,
        "linewidth": 1.0,
        "zorder": 1.5,
    }
    if goal.boxes:
        for x0, y0, x1, y1 in goal.boxes:
            axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, **style))
    else:
        axes.add_patch(Circle((goal.x, goal.y), goal.radius, **style))
    axes.plot([goal.x], [goal.y], marker="*", markersize=7, color=GOAL, zorder=3, linestyle="none")
    if goal.heading is not None:
        reach = 2 * (goal.radius or ARROW_M)
        _arrow(axes, goal.x, goal.y, goal.heading, reach, GOAL)


def _draw_start(axes: Axes, start: Pose, extent_m: float) -> None:
    axes.plot([start.x], [start.y], marker="o", markersize=5, color=START, zorder=3, linestyle="none")
    _arrow(axes, start.x, start.y, start.heading, min(0.12, 0.1 * extent_m), START)


def _arrow(axes: Axes, x: float, y: float, heading: float, length_m: float, color: str) -> None:
    tip = (x + length_m * math.cos(heading), y + length_m * math.sin(heading))
    axes.annotate(
        "", tip, (x, y), arrowprops={"arrowstyle": "-|>", "color": color, "linewidth": 1.4}, zorder=3
    )

"""How far the nearest wall is, by table: a grid of distances with bilinear lookup and a stated error.

The table answers millions of points; whatever it cannot decide within its error goes to the
exact clearance of `planners.maze.maze.Maze`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from planners.maze.maze import Maze
from planners.maze.raster import Raster
from planners.maze.settings import DISTANCE

"""Without a wanted resolution the table grows to this many nodes, or one per cell of an occupancy grid."""
"""Bound on the table's size: finer tables are coarsened (peak memory about 30 bytes per node)."""

_HALF_DIAGONAL = math.sqrt(0.5)


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Distances to the nearest wall on a square grid of nodes.

    Attributes
    ----------
    values : ndarray of float32, shape (rows, columns)
        Distance in metres at node (row, column), 0 in walls.
    origin : (float, float)
        Position of node (0, 0) in metres; rows go up, columns to the right.
    resolution : float
        Spacing of the nodes in metres.
    bounds : Box
        The maze's bounds; beyond them the distance is 0.
    error_m : float
        The looked-up value differs from the exact distance by at most this, in metres.
    """

    values: NDArray[np.float32]
    origin: tuple[float, float]
    resolution: float
    bounds: tuple[float, float, float, float]
    error_m: float

    def clearance(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the distance in metres of `points`, shape (..., 2), to the next wall, within `error_m`."""
        xy = np.asarray(points, dtype=float)
        rows, columns = self.values.shape
        u = (xy[..., 0] - self.origin[0]) / self.resolution
        v = (xy[..., 1] - self.origin[1]) / self.resolution
        beyond = xy.size > 0 and not (
            u.min() >= 0 and v.min() >= 0 and u.max() <= columns - 1 and v.max() <= rows - 1
        )
        if beyond:
            u, v = u.clip(0.0, columns - 1), v.clip(0.0, rows - 1)
        i = np.minimum(v.astype(np.int64), max(rows - 2, 0))
        j = np.minimum(u.astype(np.int64), max(columns - 2, 0))
        du, dv = u - j, v - i
        up, right = min(1, rows - 1), min(1, columns - 1)
        node, flat = i * columns + j, self.values.ravel()  # one index each: half the time of two
        low = flat.take(node)
        low = low + (flat.take(node + right) - low) * du
        node += up * columns
        high = flat.take(node)
        high = high + (flat.take(node + right) - high) * du
        between = low + (high - low) * dv
        # the distance to the bounds is concave: between nodes it is above what lies between theirs
        return np.minimum(between, _inward(self.bounds, xy)) if beyond else np.asarray(between)

    def at_least(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return a distance in metres that the exact one is never below: `clearance` less its error."""
        return np.maximum(self.clearance(points) - self.error_m, 0.0)

    @classmethod
    def of(
        cls,
        maze: Maze,
        resolution_m: float | None = None,
        max_nodes: int | None = None,
        *,
        finest_m: float | None = None,
    ) -> DistanceField:
        """Tabulate `maze`.

        Parameters
        ----------
        maze : Maze
        resolution_m : float, optional
            Spacing of the nodes; by default `finest_m`, or coarser in wide mazes. Taken larger where the
            table would exceed `max_nodes`, and fitted to the cells of an occupancy grid.
        max_nodes : int, optional
            Bound on the number of nodes, which bounds memory; by default that of `DISTANCE`.
        finest_m : float, optional
            Finest spacing that is taken by default; without, that of `DISTANCE`.
        """
        spacing = _spacing(
            maze, resolution_m, max_nodes or DISTANCE.most_nodes, finest_m or DISTANCE.finest_m
        )
        columns = max(1, math.ceil(maze.width_m / spacing - 1e-9))
        rows = max(1, math.ceil(maze.height_m / spacing - 1e-9))
        origin = (maze.bounds[0] + spacing / 2, maze.bounds[1] + spacing / 2)
        x = origin[0] + spacing * np.arange(columns, dtype=np.float64)
        y = origin[1] + spacing * np.arange(rows, dtype=np.float64)
        values = np.full((rows, columns), np.inf, dtype=np.float32)
        node_error = 0.0
        if len(maze.walls):
            np.minimum(values, _from_shapes(maze, x, y, spacing), out=values)
            node_error = _HALF_DIAGONAL * spacing
        if maze.raster is not None:
            table, error = _from_raster(maze.raster, x, y, spacing)
            np.minimum(values, table, out=values)
            node_error = max(node_error, error)
        xmin, ymin, xmax, ymax = maze.bounds
        for inward, shape in (
            (np.minimum(x - xmin, xmax - x), (1, -1)),
            (np.minimum(y - ymin, ymax - y), (-1, 1)),
        ):
            edge = np.maximum(inward, 0.0).astype(np.float32).reshape(shape)
            np.minimum(values, edge, out=values)
        # a distance's gradient is 1: interpolation errs by the way to the far nodes at most; float32 rounds
        rounding = 1e-6 * max(1.0, maze.width_m, maze.height_m)
        return cls(values, origin, spacing, maze.bounds, node_error + _HALF_DIAGONAL * spacing + rounding)


def _spacing(maze: Maze, wanted: float | None, max_nodes: int, finest_m: float) -> float:
    """Return the node spacing in metres."""
    cell = maze.raster.cell_m if maze.raster is not None else None

    def at_least(nodes: int) -> float:
        return max(math.sqrt(maze.width_m * maze.height_m / nodes), max(maze.width_m, maze.height_m) / nodes)

    if wanted is None:
        wanted = max(finest_m, min(at_least(DISTANCE.nodes), cell or math.inf))
    spacing = max(wanted, at_least(max_nodes))
    if cell is None:
        return spacing
    return (
        cell / math.floor(cell / spacing + 1e-9)
        if spacing < cell
        else cell * math.ceil(spacing / cell - 1e-9)
    )


def _inward(bounds: tuple[float, float, float, float], xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance of points to the outside of the bounds, 0 beyond."""
    xmin, ymin, xmax, ymax = bounds
    across = np.minimum(xy[..., 0] - xmin, xmax - xy[..., 0])
    return np.maximum(np.minimum(across, np.minimum(xy[..., 1] - ymin, ymax - xy[..., 1])), 0.0)


def _transform(occupied: NDArray[np.bool_], spacing: float) -> NDArray[np.float32]:
    """Return the distance of every node to the nearest occupied one, in metres."""
    from scipy.ndimage import distance_transform_edt

    if not occupied.any():
        return np.full(occupied.shape, np.inf, dtype=np.float32)
    # the nearest node itself: distances made of it here take a third of the time, and no doubles
    nearest: Any = distance_transform_edt(~occupied, return_distances=False, return_indices=True)
    squared = np.zeros(occupied.shape, dtype=np.float32)
    for axis, at in enumerate(nearest):
        own = np.arange(occupied.shape[axis], dtype=np.int32).reshape((-1, 1) if axis == 0 else (1, -1))
        at -= own
        away = at.astype(np.float32)
        squared += np.square(away, out=away)
    np.sqrt(squared, out=squared)
    squared *= np.float32(spacing)
    return squared


def _from_shapes(
    maze: Maze, x: NDArray[np.float64], y: NDArray[np.float64], spacing: float
) -> NDArray[np.float32]:
    """Return node distances to the wall shapes, wrong by half a diagonal of the node spacing at most.

    A node is marked when a wall comes within half a diagonal of it. So every wall point lies that
    near to a marked node, and every marked node that near to a wall.
    """
    near = _HALF_DIAGONAL * spacing
    marked = np.zeros((len(y), len(x)), dtype=bool)
    boxes = maze.walls.boxes()
    for skeleton, radius, (xmin, ymin, xmax, ymax) in zip(maze.walls.skeletons, maze.walls.radii, boxes):
        columns = slice(*np.searchsorted(x, (xmin - near, xmax + near)))
        rows = slice(*np.searchsorted(y, (ymin - near, ymax + near)))
        xs = x[columns]
        if not len(xs):
            continue
        if _is_box(skeleton):
            (left, low, right, high), reach = shapely.bounds(skeleton), radius + near
            across = np.maximum(np.maximum(left - xs, xs - right), 0.0)
            along = np.maximum(np.maximum(low - y[rows], y[rows] - high), 0.0)
            marked[rows, columns] |= across**2 <= reach**2 - along[:, None] ** 2
            continue
        shapely.prepare(skeleton)
        band = max(1, 500_000 // len(xs))
        for first in range(rows.start, rows.stop, band):
            ys = y[first : min(first + band, rows.stop)]
            nodes = shapely.points(*np.meshgrid(xs, ys))
            marked[first : first + len(ys), columns] |= shapely.dwithin(skeleton, nodes, radius + near)
    return _transform(marked, spacing)


def _is_box(skeleton: Any) -> bool:
    """Return whether a shape fills its bounding box: points, straight walls and boxes along the axes."""
    if skeleton.geom_type == "LineString" and len(skeleton.coords) > 2:
        return False
    xmin, ymin, xmax, ymax = skeleton.bounds
    width, height = xmax - xmin, ymax - ymin
    if skeleton.geom_type == "Polygon":
        return bool(skeleton.area >= width * height * (1 - 1e-12))
    return skeleton.geom_type in ("Point", "LineString") and min(width, height) == 0


def _from_raster(
    raster: Raster, x: NDArray[np.float64], y: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float32], float]:
    """Return node distances to the occupied cells, and by how much they may be wrong."""
    table, step, error = raster_distances(raster, spacing)
    aligned = table.shape == (len(y), len(x)) and raster.origin.heading == 0.0
    corner = (x[0] - spacing / 2, y[0] - spacing / 2)
    if aligned and max(abs(raster.origin.x - corner[0]), abs(raster.origin.y - corner[1])) < 1e-6 * spacing:
        return table, error
    values = np.empty((len(y), len(x)), dtype=np.float32)
    for i, height in enumerate(y):
        uv = raster.to_grid(np.stack([x, np.full(len(x), height)], axis=-1))
        row = np.clip((uv[:, 1] / step).astype(np.int64), 0, table.shape[0] - 1)
        column = np.clip((uv[:, 0] / step).astype(np.int64), 0, table.shape[1] - 1)
        values[i] = table[row, column]
    return values, error + _HALF_DIAGONAL * step


def raster_distances(raster: Raster, spacing: float) -> tuple[NDArray[np.float32], float, float]:
    """Return distances from the centres of square pieces of the grid to the nearest occupied cell.

    A piece is a part of a cell, or a pool of cells (occupied if any is), about `spacing` large.

    Returns
    -------
    table : ndarray of float32
        Distances in metres.
    piece : float
        Side of a piece in metres.
    error : float
        How far the distances may be off, in metres.
    """
    occupied, piece = raster.occupied, raster.cell_m
    pool = max(1, math.floor(spacing / raster.cell_m + 1e-9))
    split = max(1, round(raster.cell_m / spacing))
    if pool > 1:
        rows, columns = occupied.shape
        occupied = np.pad(occupied, ((0, -rows % pool), (0, -columns % pool)))
        pools = occupied.reshape(occupied.shape[0] // pool, pool, -1, pool)
        occupied = np.asarray(pools.any(axis=(1, 3)))
        piece *= pool
    elif split > 1:
        occupied = occupied.repeat(split, axis=0).repeat(split, axis=1)
        piece /= split
    table = _transform(occupied, piece)
    if pool > 1:
        return table, piece, piece * math.sqrt(2)
    # from centre to centre it is D; to the square itself between D - 0.707 and D - 0.5 pieces
    middle, half = 0.5 * (_HALF_DIAGONAL + 0.5) * piece, 0.5 * (_HALF_DIAGONAL - 0.5) * piece
    np.maximum(table - np.float32(middle), 0.0, out=table)
    return table, piece, half

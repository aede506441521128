"""Raster walls: an occupancy grid, every occupied cell an exact square, placed and turned anywhere."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from planners.maze.places import Box, Pose
from planners.maze.settings import DISTANCE
from srs_opt.geometry import rotate, rotate_back

Unknown = Literal["wall", "free"]
"""What cells that nobody has seen are taken for."""

MAX_CELLS = 64_000_000
"""Larger grids are refused: 8000 x 8000 cells."""


@dataclass(frozen=True, eq=False)
class Raster:
    """An occupancy grid.

    Attributes
    ----------
    occupied : ndarray of bool, shape (rows, columns)
        Row 0 is the lowest, column 0 the leftmost (before turning).
    cell_m : float
        Side of a cell in metres.
    origin : Pose
        Where the outer corner of cell (0, 0) lies and how far the grid is turned about it.
    unknown : ndarray of bool, shape (rows, columns), optional
        Cells that nobody has seen, whichever of free and occupied they are taken for (for pictures).
    """

    occupied: NDArray[np.bool_]
    cell_m: float
    origin: Pose = field(default_factory=lambda: Pose(0.0, 0.0, 0.0))
    unknown: NDArray[np.bool_] | None = None

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height in metres, along the grid's own axes."""
        rows, columns = self.occupied.shape
        return columns * self.cell_m, rows * self.cell_m

    def to_grid(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points, shape (..., 2), in metres along the grid's own axes from its corner."""
        dx, dy = xy[..., 0] - self.origin.x, xy[..., 1] - self.origin.y
        return np.stack(rotate_back(self.origin.heading, dx, dy), axis=-1)

    def to_world(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points, shape (..., 2), from the grid's own axes in the maze's."""
        x, y = rotate(self.origin.heading, uv[..., 0], uv[..., 1])
        return np.stack([self.origin.x + x, self.origin.y + y], axis=-1)

    def frame(self) -> Any:
        """Return the outline of the whole grid as a shapely polygon."""
        width, height = self.size_m
        corners = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
        return shapely.Polygon(self.to_world(corners))

    def bounds(self) -> Box:
        """Return the box around the whole grid."""
        xmin, ymin, xmax, ymax = self.frame().bounds
        return xmin, ymin, xmax, ymax

    def scaled(self, factor: float) -> Raster:
        """Return the grid with all lengths multiplied by `factor`."""
        return replace(self, cell_m=self.cell_m * factor, origin=self.origin.scaled(factor))

    def distance(self, geometry: Any, limit_m: float = math.inf) -> float:
        """Return the exact distance in metres of a shapely `geometry` to the nearest occupied cell.

        Cells are looked for in growing windows about the geometry; beyond `limit_m` the search
        stops and `limit_m` is returned. Infinite when no cell is occupied.
        """
        local = shapely.transform(geometry, self.to_grid)
        reach = min(4 * self.cell_m, limit_m)
        rows, columns = self.occupied.shape
        while True:
            window = self._window(local.bounds, reach)
            found = self._nearest(local, window)
            whole = window == (slice(0, rows), slice(0, columns))
            if found <= reach or whole or reach >= limit_m:
                return min(found, limit_m)
            # a cell was seen beyond the window's reach: only nearer ones can still matter
            reach = min(found, 2 * reach, limit_m)

    def point_distances(
        self, points: NDArray[np.float64], limit_m: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the exact distance of points (n, 2) to the nearest occupied cell, at most `limit_m` (n,).

        All points look at the cells about their own together, and then those at twice as many whose nearest
        may lie farther away; points far from everything look on by themselves.
        """
        at = self.to_grid(np.asarray(points, dtype=float)) / self.cell_m
        home, nearest = np.floor(at).astype(np.int64), limit_m / self.cell_m
        open_still, reach = np.arange(len(at)), 1
        while open_still.size and reach <= DISTANCE.looked_cells:
            many = max(1, DISTANCE.cells_at_once // (2 * reach + 1) ** 2)
            for first in range(0, open_still.size, many):
                some = open_still[first : first + many]
                nearest[some] = np.minimum(nearest[some], self._among(at[some], home[some], reach))
            open_still = open_still[nearest[open_still] > reach]
            reach *= 2
        found = np.asarray(np.minimum(nearest * self.cell_m, limit_m))
        for index in open_still:
            found[index] = self.distance(shapely.Point(points[index]), float(found[index]))
        return found

    def _among(self, at: NDArray[np.float64], home: NDArray[np.int64], reach: int) -> NDArray[np.float64]:
        """Return the distance (n,), in cells, of points to the nearest occupied cell up to `reach` off."""
        cells = home[:, :, None] + np.arange(-reach, reach + 1)
        gap = np.maximum(np.maximum(cells - at[:, :, None], at[:, :, None] - cells - 1), 0.0) ** 2
        rows, columns = self.occupied.shape
        (column, row), inside = cells.transpose(1, 0, 2), (cells >= 0) & (cells < [[columns], [rows]])
        occupied = self.occupied[row.clip(0, rows - 1)[:, :, None], column.clip(0, columns - 1)[:, None, :]]
        occupied = occupied & inside[:, 1, :, None] & inside[:, 0, None, :]
        squared = np.where(occupied, gap[:, 1, :, None] + gap[:, 0, None, :], np.inf)
        return np.asarray(np.sqrt(squared.min(axis=(1, 2))))

    def _window(self, box: Box, reach: float) -> tuple[slice, slice]:
        rows, columns = self.occupied.shape

        def span(low: float, high: float, count: int) -> slice:
            first = min(max(math.floor((low - reach) / self.cell_m) - 1, 0), count)
            last = min(max(math.ceil((high + reach) / self.cell_m) + 1, first), count)
            return slice(first, last)

        return span(box[1], box[3], rows), span(box[0], box[2], columns)

    def _nearest(self, local: Any, window: tuple[slice, slice]) -> float:
        """Return the distance of `local` to the nearest occupied cell of the window."""
        best = math.inf
        rows, columns = window
        band = max(1, DISTANCE.cells_at_once // max(1, columns.stop - columns.start))  # bounds the memory
        for first in range(rows.start, rows.stop, band):
            cells = np.argwhere(self.occupied[first : min(first + band, rows.stop), columns])
            best = min(best, self._nearest_of(local, cells + (first, columns.start), best))
        return best

    def _nearest_of(self, local: Any, cells: NDArray[np.int64], best: float) -> float:
        """Return the distance of `local` to the nearest of `cells` (row, column), or `best` if less."""
        low = cells[:, ::-1] * self.cell_m
        high = low + self.cell_m
        xmin, ymin, xmax, ymax = local.bounds
        gap = np.maximum(np.maximum(low - (xmax, ymax), (xmin, ymin) - high), 0.0)
        at_least = np.hypot(gap[:, 0], gap[:, 1])  # distance to the box around the geometry
        order = np.argsort(at_least, kind="stable")
        for start in range(0, len(order), 256):
            some = order[start : start + 256]
            if at_least[some[0]] >= best:
                break
            squares = shapely.box(low[some, 0], low[some, 1], high[some, 0], high[some, 1])
            best = min(best, float(shapely.distance(local, squares).min()))
        return best

"""The maze: bounds, walls, start and goal, with exact clearances.

Outside of the bounds is wall. Walls may be shapes, an occupancy grid, or both.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from planners.maze.places import Box, Goal, Pose
from planners.maze.raster import Raster
from planners.maze.walls import Walls

MAX_EXTENT_M = 1e5
"""Coordinates beyond this are refused: nothing in metres is that far."""


@dataclass(frozen=True, eq=False)
class Maze:
    """A maze; all lengths in metres, angles in radians.

    Attributes
    ----------
    name : str
    bounds : Box
        xmin, ymin, xmax, ymax; outside is wall.
    walls : Walls
        Wall shapes.
    raster : Raster or None
        Occupied cells, besides the shapes.
    start : Pose or None
        Centre of mass of the straight robot and its mean heading.
    goal : Goal or None
    source : str
        The file it came from, for messages.
    """

    name: str
    bounds: Box
    walls: Walls = field(default_factory=Walls)
    raster: Raster | None = None
    start: Pose | None = None
    goal: Goal | None = None
    source: str = "maze"

    @property
    def width_m(self) -> float:
        """Extent along x in metres."""
        return self.bounds[2] - self.bounds[0]

    @property
    def height_m(self) -> float:
        """Extent along y in metres."""
        return self.bounds[3] - self.bounds[1]

    def clearance(self, geometry: Any, limit_m: float = math.inf) -> float:
        """Return the exact distance in metres of a shapely `geometry` to the nearest wall.

        It is 0 where the geometry touches a wall, overlaps one or leaves the bounds. Distances
        above `limit_m` may be answered by `limit_m`, which saves time in wide mazes.
        """
        return float(self.clearances(np.array([geometry], dtype=object), limit_m)[0])

    def clearances(
        self, geometries: ArrayLike, limit_m: float | NDArray[np.float64] = math.inf
    ) -> NDArray[np.float64]:
        """Return `clearance` of each of the shapely `geometries`, shape (n,); limits may differ."""
        shapes = np.asarray(geometries, dtype=object)
        extent = np.asarray(shapely.bounds(shapes), dtype=float).reshape(-1, 4)
        inward = np.concatenate(
            [extent[:, :2] - self.bounds[:2], np.array(self.bounds[2:]) - extent[:, 2:]], axis=1
        )
        nearest = np.asarray(np.clip(inward.min(axis=1, initial=math.inf), 0.0, limit_m))
        open_still = nearest > 0
        nearest[open_still] = np.minimum(
            nearest[open_still], self.walls.distance(shapes[open_still], nearest[open_still])
        )
        if self.raster is not None:
            for i in np.flatnonzero(nearest > 0):
                nearest[i] = min(nearest[i], self.raster.distance(shapes[i], float(nearest[i])))
        return nearest

    def point_clearances(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the exact distance in metres of `points`, shape (n, 2), to the nearest wall."""
        xy = np.asarray(points, dtype=float).reshape(-1, 2)
        low, high = np.array(self.bounds[:2]), np.array(self.bounds[2:])
        nearest = np.maximum(np.minimum(xy - low, high - xy).min(axis=1, initial=math.inf), 0.0)
        nearest = np.minimum(nearest, self.walls.distance(shapely.points(xy), nearest))
        return nearest if self.raster is None else self.raster.point_distances(xy, nearest)

    def inside_bounds(self, x: float, y: float) -> bool:
        """Whether the point lies within the bounds (metres)."""
        xmin, ymin, xmax, ymax = self.bounds
        return xmin <= x <= xmax and ymin <= y <= ymax

    def with_places(self, start: Pose | None = None, goal: Goal | None = None) -> Maze:
        """Return the maze with start or goal replaced where given."""
        return replace(self, start=start or self.start, goal=goal or self.goal)

    def scaled(self, factor: float) -> Maze:
        """Return the maze with all lengths multiplied by `factor`."""
        if factor == 1.0:
            return self
        xmin, ymin, xmax, ymax = self.bounds
        return replace(
            self,
            bounds=(xmin * factor, ymin * factor, xmax * factor, ymax * factor),
            walls=self.walls.scaled(factor),
            raster=self.raster and self.raster.scaled(factor),
            start=self.start and self.start.scaled(factor),
            goal=self.goal and self.goal.scaled(factor),
        )

    @cached_property
    def fingerprint(self) -> str:
        """A hash of everything that bears on planning (not of name and source)."""
        digest = hashlib.sha256()
        for piece in self._pieces():
            digest.update(piece)
        return digest.hexdigest()[:16]

    def _pieces(self) -> Iterator[bytes]:
        yield repr((self.bounds, self.start, self.goal)).encode()
        for shape in self.walls.skeletons:
            yield shapely.to_wkb(shape)
        yield self.walls.radii.tobytes()
        if self.raster is not None:
            yield repr((self.raster.occupied.shape, self.raster.cell_m, self.raster.origin)).encode()
            yield np.packbits(self.raster.occupied).tobytes()

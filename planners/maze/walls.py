"""Vector walls: skeletons (points, lines, polygons) thickened by a radius; distances to them are exact.

A disc is a point with a radius, a wall of given thickness is a line with half of it as
radius (so its ends are round), a polygon has radius 0. Polygonal outlines that contain the
true shape serve the search tree and pictures; the distance itself never uses them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from planners.maze.places import Box
from planners.maze.settings import DISTANCE


def _no_shapes() -> NDArray[Any]:
    return np.empty(0, dtype=object)


@dataclass(frozen=True, eq=False)
class Walls:
    """Wall shapes as thickened skeletons.

    Attributes
    ----------
    skeletons : ndarray of shapely geometries, shape (n,)
    radii : ndarray of float, shape (n,)
        How far each wall reaches beyond its skeleton, in metres.
    """

    skeletons: NDArray[Any] = field(default_factory=_no_shapes)
    radii: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(cls, shapes: list[tuple[Any, float]]) -> Walls:
        """Return walls from (skeleton, radius in metres) pairs."""
        skeletons = np.empty(len(shapes), dtype=object)
        skeletons[:] = [shape for shape, _ in shapes]
        return cls(skeletons, np.array([radius for _, radius in shapes], dtype=float))

    def __len__(self) -> int:
        return len(self.skeletons)

    @cached_property
    def outlines(self) -> NDArray[Any]:
        """Polygons that contain the walls, at most 0.13 % of the radius too large; shape (n,)."""
        outlines: NDArray[Any] = self.skeletons.copy()
        thick = self.radii > 0
        if thick.any():
            outlines[thick] = shapely.buffer(
                self.skeletons[thick], self.radii[thick] * DISTANCE.containing, quad_segs=DISTANCE.chords
            )
        return outlines

    @cached_property
    def union(self) -> Any:
        """The union of the outlines, one shapely geometry (for pictures and rough work)."""
        return shapely.union_all(self.outlines) if len(self) else shapely.MultiPolygon()

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(self.outlines)

    @cached_property
    def _slack(self) -> float:
        return float(self.radii.max(initial=0.0)) * (DISTANCE.containing - 1.0) * 1.01 + 1e-9

    def distance(
        self, geometries: NDArray[Any], limit_m: float | NDArray[np.float64] = math.inf
    ) -> NDArray[np.float64]:
        """Return the exact distance in metres of each of the shapely `geometries` to the nearest wall.

        It is 0 where they touch or overlap and infinite when there are no walls. With a finite limit,
        walls farther away than that are not looked for (much faster), and the limit is the answer.
        """
        limit = np.broadcast_to(np.asarray(limit_m, dtype=float), (len(geometries),))
        nearest: NDArray[np.float64] = limit.copy()
        if not len(self) or not len(geometries):
            return nearest
        if np.isfinite(limit).all():
            reach = limit
        else:
            (asked, _), rough = self._tree.query_nearest(geometries, all_matches=False, return_distance=True)
            reach = np.full(len(geometries), 0.0)
            reach[asked] = rough + self._slack  # the outline is nearer than the wall, by the slack at most
        which, wall = self._tree.query(geometries, predicate="dwithin", distance=reach)
        exact = shapely.distance(geometries[which], self.skeletons[wall]) - self.radii[wall]
        np.minimum.at(nearest, which, np.maximum(exact, 0.0))
        return nearest

    def boxes(self) -> NDArray[np.float64]:
        """Return the bounding box of every wall, shape (n, 4)."""
        if not len(self):
            return np.zeros((0, 4))
        grow = self.radii[:, None] * np.array([-1.0, -1.0, 1.0, 1.0])
        boxes: NDArray[np.float64] = np.asarray(shapely.bounds(self.skeletons), dtype=float) + grow
        return boxes

    def scaled(self, factor: float) -> Walls:
        """Return walls with all lengths multiplied by `factor` (about the origin)."""
        if not len(self):
            return self
        return Walls(shapely.transform(self.skeletons, lambda xy: xy * factor), self.radii * factor)


def box_shape(box: Box) -> tuple[Any, float]:
    """Return the wall that fills `box`."""
    return shapely.box(*box), 0.0

"""Clearance of the whole body from the walls: by distance field where that decides, else exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from planners.maze.field import DistanceField
from planners.maze.maze import Maze
from planners.search.settings import RESOLUTION

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BodyClearance:
    """Clearance of bodies given as centre lines, tail to head.

    Attributes
    ----------
    maze : Maze
    field : DistanceField
    half_width_m : float
        Half the body's width.
    margin_m : float
        Clearance to keep.
    """

    maze: Maze
    field: DistanceField
    half_width_m: float
    margin_m: float

    @property
    def reach_m(self) -> float:
        """Distance that the centre line keeps from walls."""
        return self.half_width_m + self.margin_m

    def estimate(self, lines: Array) -> Array:
        """Return the clearance (m) of each body by table, for centre lines (..., points, 2).

        Off by the table's error at most; negative inside walls.
        """
        clearance_m: Array = self.field.clearance(lines).min(axis=-1) - self.half_width_m
        return clearance_m

    def exact(self, lines: Array, roughly: Array | None = None) -> Array:
        """Return the exact clearance (m) of each body, (n,), for centre lines (n, points, 2).

        Bodies that touch or overlap walls by more than half their width answer minus half the width. Their
        `estimate` may be given where it is known.
        """
        roughly = self.estimate(lines) if roughly is None else roughly
        upper = roughly + self.half_width_m + self.field.error_m + RESOLUTION.nearest_m
        return self.maze.clearances(shapely.linestrings(lines), upper) - self.half_width_m

    def keeps_margin(self, lines: Array, slack_m: float = 0.0, roughly: Array | None = None) -> bool:
        """Whether every body of (n, points, 2) keeps the margin and `slack_m` more.

        Their `estimate` may be given where it is known.
        """
        wanted = self.margin_m + slack_m
        roughly = self.estimate(lines) if roughly is None else roughly
        if roughly.min() < wanted - self.field.error_m:
            return False
        close = roughly < wanted + self.field.error_m
        return not close.any() or bool(self.exact(lines[close], roughly[close]).min() >= wanted)

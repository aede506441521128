"""Walls as boxes that the engine's collision detector knows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

SHELL_M = 0.005  # thickness of an outline's boxes: a body that moves 1 mm per step cannot jump through it
_FULL = 0.9999  # share of its rectangle that a polygon fills to be a box


@dataclass(frozen=True)
class WallBox:
    """An upright box: middle, length along `heading_rad`, width across."""

    x_m: float
    y_m: float
    length_m: float
    width_m: float
    heading_rad: float


def wall_boxes(region: Any) -> list[WallBox]:
    """Return boxes that stand for a shapely region of solid walls.

    A rectangle is one box. Any other polygon becomes a shell: a box of `SHELL_M` inside every edge.
    """
    boxes: list[WallBox] = []
    for part in shapely.get_parts(region):
        if part.geom_type != "Polygon" or part.is_empty:
            continue
        polygon = shapely.simplify(part, 1e-6)
        around = shapely.minimum_rotated_rectangle(polygon)
        if not polygon.interiors and polygon.area > _FULL * around.area:
            boxes.append(_rectangle(around))
        else:
            polygon = shapely.orient_polygons(polygon)  # solid to the left of every edge
            for ring in (polygon.exterior, *polygon.interiors):
                boxes += _shell(np.asarray(ring.coords))
    return boxes


def _rectangle(rectangle: Any) -> WallBox:
    corners = np.asarray(rectangle.exterior.coords)[:4]
    middle, (along, across) = corners.mean(axis=0), (corners[1] - corners[0], corners[3] - corners[0])
    length, width = np.hypot(*along), np.hypot(*across)
    x, y = map(float, middle)
    return WallBox(x, y, float(length), float(width), math.atan2(along[1], along[0]))


def _shell(ring: Any) -> list[WallBox]:
    boxes = []
    for a, b in pairwise(ring):
        along = b - a
        length = float(np.hypot(*along))
        if length == 0.0:
            continue
        inward = np.array([-along[1], along[0]]) / length
        middle = (a + b) / 2 + inward * SHELL_M / 2
        x, y = map(float, middle)
        boxes.append(WallBox(x, y, length, SHELL_M, math.atan2(along[1], along[0])))
    return boxes

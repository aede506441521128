"""Walls of a motion.json as the engine has them: rings, occupied cells, and everything beyond the bounds."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from dart_snake.walls import WallBox, wall_boxes
from srs_opt.geometry import rotation_matrix

FRAME_M = 0.05  # of the wall around the bounds


def solid_region(maze: Mapping[str, Any]) -> Any:
    """Return the walls of a maze record, as motion.json holds it, as one shapely region."""
    xmin, ymin, xmax, ymax = maze["bounds"]
    inside = shapely.box(xmin, ymin, xmax, ymax)
    parts = [inside.buffer(FRAME_M, join_style="mitre") - inside]
    if maze["rings"]:
        parts.append(
            shapely.build_area(shapely.MultiLineString([shapely.LinearRing(r) for r in maze["rings"]]))
        )
    if maze.get("cells"):
        parts += _cells(maze["cells"])
    return shapely.union_all(parts)


def boxes_of(maze: Mapping[str, Any]) -> list[WallBox]:
    """Return the boxes that the engine's body can touch."""
    return wall_boxes(solid_region(maze))


def clearances(region: Any, lines: NDArray[np.float64], width_m: float) -> NDArray[np.float64]:
    """Return the room (T,) between walls and capsules of `width_m` along center lines (T, points, 2)."""
    edges = np.array([edge for part in shapely.get_parts(region) for edge in _edges(part)], dtype=object)
    bodies = shapely.linestrings(lines)
    tree = shapely.STRtree(edges)
    (which, _), distance = tree.query_nearest(bodies, all_matches=False, return_distance=True)
    room = np.empty(len(bodies))
    room[which] = distance
    shapely.prepare(region)
    room[shapely.intersects(region, bodies)] = 0.0
    return room - width_m / 2


def _edges(polygon: Any) -> list[Any]:
    rings = (polygon.exterior, *polygon.interiors)
    points = [np.asarray(ring.coords) for ring in rings]
    return [shapely.LineString(p[k : k + 2]) for p in points for k in range(len(p) - 1)]


def _cells(cells: Mapping[str, Any]) -> list[Any]:
    """Return the occupied cells, runs of them along the rows, in the room."""
    from PIL import Image

    picture = Image.open(io.BytesIO(base64.b64decode(cells["png"]))).convert("LA")
    # a picture's rows run downwards, the room's y upwards
    occupied = np.asarray(picture)[::-1, :, 1] > 0
    x0, y0, heading = cells["origin"]
    width, height = cells["size"]
    dx, dy = width / occupied.shape[1], height / occupied.shape[0]
    runs = []
    for row, line in enumerate(occupied):
        change = np.flatnonzero(np.diff(np.concatenate([[0], line.astype(int), [0]])))
        runs += [(a * dx, row * dy, b * dx, (row + 1) * dy) for a, b in change.reshape(-1, 2)]
    if not runs:
        return []
    region = shapely.union_all(shapely.box(*np.array(runs).T))
    turn = rotation_matrix(heading)
    return [shapely.transform(region, lambda p: p @ turn.T + [x0, y0])]

"""Our maze YAML: bounds, wall shapes, a grid of cells, start and goal; documented by maze.schema.json."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from planners.maze.cells import start_in_cell
from planners.maze.maze import Maze
from planners.maze.places import Box, Goal, Pose, RobotSize
from planners.maze.raster import MAX_CELLS, Raster, Unknown
from planners.maze.walls import Walls, box_shape
from srs_opt.document import Document, load_schema, validate
from srs_opt.errors import InputError

KINDS = ("segment", "box", "polygon", "disc")
CELLS = "#.SG ?"


def maze_from_document(document: Document, size: RobotSize | None = None, unknown: Unknown = "wall") -> Maze:
    """Return the maze of a parsed file.

    Parameters
    ----------
    document : Document
    size : RobotSize, optional
        Places the robot in a start cell S of the grid.
    unknown : {"wall", "free"}
        What the grid's cells ``?`` are taken for.

    Raises
    ------
    InputError
        Naming the file, the line and the key.
    """
    if not isinstance(document.value, dict):
        raise InputError(f"{document.source}: not a maze: expected the keys bounds, walls, grid, start, goal")
    validate(document, load_schema("planners.maze", "maze.schema.json"))
    value = document.value
    if "bounds" not in value and "grid" not in value:
        raise document.error(
            (), "key 'bounds' is missing (a maze without a grid needs [xmin, ymin, xmax, ymax])"
        )
    bounds = _box(document, ("bounds",), value["bounds"]) if "bounds" in value else None
    walls = Walls.of([_wall(document, ("walls", i), wall) for i, wall in enumerate(value.get("walls", []))])
    raster, start, goal = None, None, None
    if "grid" in value:
        raster, start, goal, extent = _grid(document, bounds, size or RobotSize(), unknown)
        bounds = bounds or extent
    assert bounds is not None  # one of the two was required above
    if "start" in value:
        given = value["start"]
        start = Pose(float(given["x"]), float(given["y"]), float(given.get("heading", 0.0)))
    if "goal" in value:
        goal = _goal(document, value["goal"])
    name = value.get("name") or Path(document.source).stem
    return Maze(name, bounds, walls, raster, start, goal, document.source)


def _box(document: Document, place: tuple[str | int, ...], numbers: list[float]) -> Box:
    xmin, ymin, xmax, ymax = map(float, numbers)
    if not (xmin < xmax and ymin < ymax):
        raise document.error(
            place, f"expected [xmin, ymin, xmax, ymax] with xmin < xmax and ymin < ymax, found {numbers}"
        )
    return xmin, ymin, xmax, ymax


def _goal(document: Document, given: dict[str, Any]) -> Goal:
    boxes = given.get("boxes")
    wrong = [key for key in ("x", "y", "radius") if key in given] if boxes else []
    if wrong:
        raise document.error(("goal", wrong[0]), "a goal is either a disc (x, y, radius) or boxes, not both")
    missing = [] if boxes else [key for key in ("x", "y") if key not in given]
    if missing:
        raise document.error(("goal",), f"key '{missing[0]}' is missing (metres)")
    numbers: dict[str, Any] = {key: float(number) for key, number in given.items() if key != "boxes"}
    if not boxes:
        return Goal(**numbers)
    cells = tuple(_box(document, ("goal", "boxes", i), box) for i, box in enumerate(boxes))
    return replace(Goal.of_boxes(cells), **numbers)


def _wall(document: Document, place: tuple[str | int, ...], wall: dict[str, Any]) -> tuple[Any, float]:
    kinds = [kind for kind in KINDS if kind in wall]
    if len(kinds) != 1:
        found = " and ".join(kinds) or "none"
        raise document.error(place, f"expected exactly one of {', '.join(KINDS)}, found {found}")
    kind = kinds[0]
    if (kind == "segment") != ("thickness" in wall):
        need = "is missing (metres)" if kind == "segment" else f"belongs to a segment, not to a {kind}"
        raise document.error(place, f"key 'thickness' {need}")
    place = (*place, kind)
    if kind == "segment":
        if wall["segment"][0] == wall["segment"][1]:
            raise document.error(
                place, f"both ends are {wall['segment'][0]}; for a round post use disc: [x, y, radius]"
            )
        return shapely.LineString(wall["segment"]), float(wall["thickness"]) / 2
    if kind == "box":
        return box_shape(_box(document, place, wall["box"]))
    if kind == "disc":
        x, y, radius = map(float, wall["disc"])
        if radius <= 0:
            raise document.error(place, f"the radius must be greater than 0, found {radius:g}")
        return shapely.Point(x, y), radius
    return _polygon(document, place, wall["polygon"]), 0.0


def _polygon(document: Document, place: tuple[str | int, ...], corners: list[list[float]]) -> Any:
    polygon = shapely.Polygon(corners)
    if not polygon.is_valid:
        why = shapely.is_valid_reason(polygon)
        raise document.error(
            place, f"not a simple outline: {why}; list the corners in order, edges must not cross"
        )
    if polygon.area <= 1e-12:
        raise document.error(place, "the outline has no area; for a thin wall use a segment with thickness")
    return polygon


def _grid(
    document: Document, bounds: Box | None, size: RobotSize, unknown: Unknown
) -> tuple[Raster, Pose | None, Goal | None, Box]:
    """Return the occupancy grid, the places its S and G mark, and its extent."""
    grid = document.value["grid"]
    cell, rows = float(grid["cell"]), grid["rows"]
    letters = _letters(document, rows)
    default = bounds[:2] if bounds else (0.0, 0.0)
    x0, y0 = (float(v) for v in grid.get("origin", default))
    height, width = letters.shape
    extent = (x0, y0, x0 + width * cell, y0 + height * cell)
    slack = 1e-6 * max(1.0, *map(abs, extent))
    outer = bounds or extent
    if extent[0] < outer[0] - slack or extent[1] < outer[1] - slack:
        raise document.error(("grid", "origin"), f"the grid begins outside the bounds {list(outer)}")
    if extent[2] > outer[2] + slack or extent[3] > outer[3] + slack:
        found = f"{width} x {height} cells of {cell:g} m reach to ({extent[2]:g}, {extent[3]:g})"
        raise document.error(
            ("grid", "rows"), f"{found}, beyond the bounds {list(outer)}; widen them or omit bounds"
        )
    unseen = letters == "?"
    walls = (letters == "#") | (unseen & (unknown == "wall"))
    raster = _covering(walls, unseen if unseen.any() else None, cell, (x0, y0), outer)
    if raster is None:
        raise document.error(
            ("grid", "cell"), f"{cell:g} m cells are too small for these bounds (limit {MAX_CELLS} cells)"
        )
    boxes = [
        (x0 + column * cell, y0 + row * cell, x0 + (column + 1) * cell, y0 + (row + 1) * cell)
        for row, column in np.argwhere(letters == "G").tolist()
    ]
    starts = np.argwhere(letters == "S").tolist()
    if len(starts) > 1:
        raise document.error(("grid", "rows"), f"{len(starts)} start cells S, expected one")
    start = _start(walls, starts[0], cell, (x0, y0), size) if starts else None
    return raster, start, Goal.of_boxes(tuple(boxes)) if boxes else None, extent


def _letters(document: Document, rows: list[str]) -> NDArray[np.str_]:
    """Return the letters of the grid, the lowest row first."""
    width = len(rows[0])
    if width == 0:
        raise document.error(("grid", "rows", 0), "the row is empty")
    for i, row in enumerate(rows):
        if len(row) != width:
            raise document.error(("grid", "rows", i), f"{len(row)} cells, but the first row has {width}")
        for letter in row:
            if letter not in CELLS:
                raise document.error(
                    ("grid", "rows", i), f"unknown cell {letter!r} (# wall . free ? unseen S start G goal)"
                )
    if width * len(rows) > MAX_CELLS:
        raise document.error(
            ("grid", "rows"), f"{width} x {len(rows)} cells are too many (limit {MAX_CELLS})"
        )
    return np.array([list(row) for row in rows])[::-1]


def _covering(
    walls: NDArray[np.bool_],
    unseen: NDArray[np.bool_] | None,
    cell: float,
    corner: tuple[float, float],
    outer: Box,
) -> Raster | None:
    """Return the grid, free cells added around it until it covers the bounds (None if too many)."""

    def more(gap: float) -> int:
        return max(0, math.ceil(gap / cell - 1e-6))

    height, width = walls.shape
    left, below = more(corner[0] - outer[0]), more(corner[1] - outer[1])
    right = more(outer[2] - corner[0] - width * cell)
    above = more(outer[3] - corner[1] - height * cell)
    if (height + below + above) * (width + left + right) > MAX_CELLS:
        return None
    around = ((below, above), (left, right))
    origin = Pose(corner[0] - left * cell, corner[1] - below * cell, 0.0)
    return Raster(np.pad(walls, around), cell, origin, None if unseen is None else np.pad(unseen, around))


def _start(
    walls: NDArray[np.bool_], place: list[int], cell: float, corner: tuple[float, float], size: RobotSize
) -> Pose:
    row, column = place
    height, width = walls.shape

    def run(dx: int, dy: int) -> int:
        steps, i, j = 0, row + dy, column + dx
        while 0 <= i < height and 0 <= j < width and not walls[i, j]:
            steps, i, j = steps + 1, i + dy, j + dx
        return steps

    x, y = corner[0] + column * cell, corner[1] + row * cell
    return start_in_cell((x, y, x + cell, y + cell), size, run)

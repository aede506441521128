"""Write a maze as our YAML, readable and to the micrometre."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from planners.maze.maze import Maze
from planners.maze.places import Goal
from planners.maze.raster import Raster
from srs_opt.errors import InputError


def maze_to_yaml(maze: Maze, comment: str = "") -> str:
    """Return `maze` as the text of a maze file; every line of `comment` heads it.

    Raises
    ------
    InputError
        For an occupancy grid that is turned: our YAML has no such thing.
    """
    lines = [f"# {line}".rstrip() for line in comment.splitlines()]
    lines += [f"name: {_quoted(maze.name)}", f"bounds: {_list(maze.bounds)}"]
    if len(maze.walls):
        lines.append("walls:")
        lines += [f"  - {_wall(s, float(r))}" for s, r in zip(maze.walls.skeletons, maze.walls.radii)]
    if maze.raster is not None:
        lines += _grid(maze.raster, maze.source)
    if maze.start is not None:
        x, y, heading = _number(maze.start.x), _number(maze.start.y), _number(maze.start.heading)
        lines.append(f"start: {{x: {x}, y: {y}, heading: {heading}}}")
    if maze.goal is not None:
        lines.append(f"goal: {{{_goal(maze.goal)}}}")
    return "\n".join(lines) + "\n"


def _number(value: float) -> str:
    return repr(round(float(value), 6) + 0.0)


def _list(values: Any) -> str:
    return "[" + ", ".join(_number(value) for value in values) + "]"


def _points(shape: Any) -> str:
    return "[" + ", ".join(_list(point) for point in shapely.get_coordinates(shape)) + "]"


def _quoted(text: str) -> str:
    return '"' + "".join(c for c in text if c.isprintable()).replace("\\", "\\\\").replace('"', '\\"') + '"'


def _wall(skeleton: Any, radius: float) -> str:
    if skeleton.geom_type == "Point":
        return f"{{disc: {_list((skeleton.x, skeleton.y, radius))}}}"
    if skeleton.geom_type == "LineString":
        return f"{{segment: {_points(skeleton)}, thickness: {_number(2 * radius)}}}"
    if shapely.equals(skeleton, shapely.envelope(skeleton)):
        return f"{{box: {_list(skeleton.bounds)}}}"
    return f"{{polygon: {_points(skeleton.exterior)}}}"


def _grid(raster: Raster, source: str) -> list[str]:
    if raster.origin.heading != 0.0:
        raise InputError(
            f"{source}: a turned occupancy grid cannot be written as our YAML; keep its own format"
        )
    letters = np.where(raster.occupied, "#", ".")
    if raster.unknown is not None:
        letters[raster.unknown] = "?"
    rows = ["".join(row) for row in letters[::-1]]
    origin = _list((raster.origin.x, raster.origin.y))
    lines = ["grid:", f"  cell: {_number(raster.cell_m)}", f"  origin: {origin}", "  rows:"]
    return lines + [f'    - "{row}"' for row in rows]


def _goal(goal: Goal) -> str:
    if goal.boxes:
        text = "boxes: [" + ", ".join(_list(box) for box in goal.boxes) + "]"
    else:
        text = f"x: {_number(goal.x)}, y: {_number(goal.y)}, radius: {_number(goal.radius)}"
    if goal.heading is not None:
        text += f", heading: {_number(goal.heading)}, heading_tolerance: {_number(goal.heading_tolerance)}"
    return text

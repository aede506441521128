"""BARN worlds (Gazebo SDF): upright cylinders, boxes and spheres seen from above.

The bounds are the box around them and `MAP_FILE.world_margin_m` more on every side: the BARN benchmark
drives to a goal 3 m beyond its field. Document types and entities are refused, so nothing can be expanded.
"""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from planners.maze.maze import MAX_EXTENT_M, Maze
from planners.maze.places import Pose
from planners.maze.settings import MAP_FILE
from planners.maze.walls import Walls
from srs_opt.errors import InputError
from srs_opt.files import read_text
from srs_opt.geometry import rotate

MAX_BODIES = 100_000
Shape = tuple[Any, float]
_UNIT = "<model><link><collision><geometry>{}</geometry></collision></link></model>"
_UNIT_SHAPES = {
    "unit_box": _UNIT.format("<box><size>1 1 1</size></box>"),
    "unit_cylinder": _UNIT.format("<cylinder><radius>0.5</radius></cylinder>"),
    "unit_sphere": _UNIT.format("<sphere><radius>0.5</radius></sphere>"),
}
_FLAT = ("plane", "empty", "heightmap")
_SCENERY = ("sun", "ground_plane")


def read_world(text: str, source: str) -> Maze:
    """Return the maze of a Gazebo world, without start and goal.

    Raises
    ------
    InputError
        Naming the line (broken XML) or the model.
    """
    root = _parsed(text, source)
    world = root if root.tag == "world" else root.find("world")
    if world is None:
        raise InputError(f"{source}: no <world> in it (expected a Gazebo world: <sdf><world>...)")
    shapes = _shapes(world, source)
    if not shapes:
        raise InputError(f"{source}: no obstacles in it (expected models with cylinders or boxes)")
    walls = Walls.of(shapes)
    boxes = walls.boxes()
    margin_m = MAP_FILE.world_margin_m
    low, high = boxes[:, :2].min(axis=0) - margin_m, boxes[:, 2:].max(axis=0) + margin_m
    bounds = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    return Maze(Path(source).stem, bounds, walls, source=source)


def _parsed(text: str, source: str) -> ElementTree.Element:
    """Return the root of an XML document that declares nothing."""
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError(
            f"{source}: a document type or an entity is declared; a Gazebo world needs none, remove it"
        )
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        line = error.position[0]
        raise InputError(
            f"{source}:{line}: not valid XML: {str(error)[:80]} (expected a Gazebo world)"
        ) from error
    except ValueError as error:  # an encoding that contradicts the text
        raise InputError(f"{source}: not valid XML: {str(error)[:80]} (expected a Gazebo world)") from error
    return root


def _shapes(world: ElementTree.Element, source: str) -> list[Shape]:
    moved = {model.get("name"): model.find("pose") for model in world.findall("state/model")}
    shapes: list[Shape] = []
    for include in world.findall("include"):
        uri = (include.findtext("uri") or "").strip()
        if uri.rstrip("/").rsplit("/", 1)[-1] in _SCENERY:
            continue
        where = f"{source}: <include> of {uri[:60]!a}"
        pose = moved.get(include.findtext("name"), include.find("pose"))
        shapes += _included(uri, _pose(pose, where), where, source)
    for model in world.findall("model"):
        where = f"{source}: model '{(model.get('name') or '?')[:60]}'"
        pose = moved.get(model.get("name"))
        shapes += _model_shapes(model, _pose(pose if pose is not None else model.find("pose"), where), where)
        if len(shapes) > MAX_BODIES:
            raise InputError(f"{source}: more than {MAX_BODIES} obstacles")
    return shapes


def _model_shapes(model: ElementTree.Element, base: Pose, where: str) -> list[Shape]:
    """Return the shapes of a model placed at `base`."""
    shapes = []
    for link in model.findall("link"):
        at_link = _compose(base, _pose(link.find("pose"), where))
        for collision in link.findall("collision"):
            at = _compose(at_link, _pose(collision.find("pose"), where))
            shape = _shape(collision.find("geometry"), at, where)
            if shape is not None:
                shapes.append(shape)
    return shapes


def _included(uri: str, base: Pose, where: str, source: str) -> list[Shape]:
    """Return the shapes of an included model: one of Gazebo's unit shapes, or written out in model.sdf."""
    name = uri.removeprefix("model://").removeprefix("file://").strip("/")
    if name in _UNIT_SHAPES:
        return _model_shapes(ElementTree.fromstring(_UNIT_SHAPES[name]), base, where)
    for folder in _model_folders(source):
        file = folder / name / "model.sdf"
        if name and ".." not in Path(name).parts and file.is_file():
            root = _parsed(read_text(file, "a Gazebo model"), str(file))
            model = root if root.tag == "model" else root.find("model")
            if model is None:
                raise InputError(f"{file}: no <model> in it (expected a Gazebo model: <sdf><model>...)")
            return _model_shapes(model, _compose(base, _pose(model.find("pose"), str(file))), str(file))
    raise InputError(
        f"{where}: no model.sdf of that name beside the world, in models/ or on GAZEBO_MODEL_PATH; "
        "put it there, or write the model out"
    )


def _model_folders(source: str) -> list[Path]:
    """Return the folders in which models are looked for."""
    here = Path(source).parent
    paths = [os.environ.get(name, "") for name in ("GAZEBO_MODEL_PATH", "GZ_SIM_RESOURCE_PATH")]
    named = [Path(part) for path in paths for part in path.split(os.pathsep) if part]
    return [here, here / "models", here.parent / "models", *named]


def _numbers(text: str | None, count: int, where: str, what: str) -> list[float]:
    try:
        numbers = [float(word) for word in (text or "").split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(abs(n) <= MAX_EXTENT_M for n in numbers):  # refuses not-a-number too
        raise InputError(f"{where}: {what} is {(text or '')[:60].strip()!r}, expected {count} finite numbers")
    return numbers


def _pose(element: ElementTree.Element | None, where: str) -> Pose:
    if element is None or not (element.text or "").strip():
        return Pose(0.0, 0.0, 0.0)
    if element.get("frame") or element.get("relative_to"):
        raise InputError(
            f"{where}: its pose is relative to another frame, which is not supported; give it in the world's"
        )
    x, y, _, roll, pitch, yaw = _numbers(element.text, 6, where, "pose")
    if max(abs(math.remainder(roll, math.pi)), abs(math.remainder(pitch, math.pi))) > MAP_FILE.upright_rad:
        raise InputError(
            f"{where}: it is tilted (roll {roll:g}, pitch {pitch:g}); expected upright obstacles"
        )
    return Pose(x, y, yaw)


def _compose(base: Pose, inner: Pose) -> Pose:
    x, y = rotate(base.heading, inner.x, inner.y)
    return Pose(base.x + float(x), base.y + float(y), base.heading + inner.heading)


def _shape(geometry: ElementTree.Element | None, at: Pose, where: str) -> Shape | None:
    if geometry is None or len(geometry) == 0 or geometry[0].tag in _FLAT:
        return None
    kind = geometry[0].tag
    if kind in ("cylinder", "sphere"):
        (radius,) = _numbers(geometry[0].findtext("radius"), 1, where, f"{kind} radius")
        if radius <= 0:
            raise InputError(f"{where}: {kind} radius must be greater than 0, found {radius:g}")
        return shapely.Point(at.x, at.y), radius
    if kind == "box":
        width, depth, height = _numbers(geometry[0].findtext("size"), 3, where, "box size")
        if min(width, depth, height) <= 0:
            raise InputError(
                f"{where}: box size must be greater than 0, found {width:g} {depth:g} {height:g}"
            )
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (width / 2, depth / 2)
        return shapely.Polygon([_place(at, corner) for corner in corners.tolist()]), 0.0
    raise InputError(f"{where}: shape '{kind[:40]}' is not supported (cylinder, box, sphere)")


def _place(at: Pose, corner: list[float]) -> tuple[float, float]:
    placed = _compose(at, Pose(corner[0], corner[1], 0.0))
    return placed.x, placed.y

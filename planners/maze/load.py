"""Read a maze from a file of any known format, told by its content, else by its ending."""

from __future__ import annotations

import math
import re
from codecs import BOM_UTF8
from collections.abc import Callable
from pathlib import Path

from planners.maze.barn import read_world
from planners.maze.maze import MAX_EXTENT_M, Maze
from planners.maze.micromouse import read_micromouse
from planners.maze.micromouse_numbers import MAZ_BYTES, read_maz, read_numbers
from planners.maze.movingai import map_of, read_map, read_scenarios, with_scenario
from planners.maze.native import maze_from_document
from planners.maze.places import Goal, Pose, RobotSize
from planners.maze.raster import Unknown
from planners.maze.ros import maze_from_map_server
from srs_opt.document import parse_yaml
from srs_opt.errors import InputError
from srs_opt.files import read_bytes, read_text

MAX_YAML_BYTES = 2_000_000
MAX_TEXT_BYTES = 8_000_000
MAX_MAP_BYTES = 150_000_000
ENDINGS = {
    ".yaml": "yaml",
    ".yml": "yaml",
    ".json": "yaml",
    ".map": "movingai",
    ".scen": "scenario",
    ".txt": "micromouse",
    ".maz": "micromouse",
    ".num": "numbers",
    ".world": "world",
    ".sdf": "world",
    ".xml": "world",
}
KNOWN = (
    "our maze YAML, a ROS map_server YAML, a MovingAI .map or .scen, a micromouse .txt, .num or .maz, "
    "a BARN .world"
)
HEAD_BYTES = 4096
Reader = Callable[[str, "float | None", RobotSize], Maze]
_own: dict[str, Reader] = {}
_POSTS = re.compile(rb"[o+O.]((---|   )[o+O.])+")
_SIX_NUMBERS = re.compile(rb"\d+(\s+\d+){5}")


def load_maze(
    path: Path | str,
    cell_m: float | None = None,
    scale: float = 1.0,
    *,
    robot_length_m: float = RobotSize.length_m,
    body_half_width_m: float = RobotSize.half_width_m,
    margin_m: float = RobotSize.margin_m,
    start: Pose | None = None,
    goal: Goal | None = None,
    unknown: Unknown = "wall",
) -> Maze:
    """Read a maze.

    Parameters
    ----------
    path : path
        Any known format; ``file.scen#3`` is the third scenario of a MovingAI scenario file.
    cell_m : float, optional
        Cell size in metres of formats that have none: micromouse (0.18) and MovingAI (0.1).
    scale : float
        Multiplies all lengths of the file (not those of the robot, `start` or `goal`).
    robot_length_m, body_half_width_m, margin_m : float
        The straight robot and the clearance it keeps, to place it in a start cell.
    unknown : {"wall", "free"}
        What unknown cells of a map are taken for.
    start, goal : optional
        Take the place of the file's; whether they are possible, `placement.check_placement` tells.

    Raises
    ------
    InputError
        One line naming file, line, what was found and what was expected.
    """
    for name, number in (("cell size", cell_m), ("scale", scale)):
        if number is not None and not (0 < number < MAX_EXTENT_M):
            raise InputError(f"{name} must be a number above 0 and below {MAX_EXTENT_M:g}, found {number}")
    size = RobotSize(robot_length_m, body_half_width_m, margin_m).scaled(1 / scale)
    maze = _read(str(path), cell_m, size, unknown).scaled(scale)
    if not all(math.isfinite(v) and abs(v) <= MAX_EXTENT_M for v in maze.bounds):
        raise InputError(
            f"{path}: the maze reaches beyond {MAX_EXTENT_M:g} m; choose a smaller --cell or --scale"
        )
    return maze.with_places(start, goal)


def register_maze_format(ending: str, read: Reader) -> None:
    """Make a maze format of one's own known by its files' ending; it is asked before the others.

    Parameters
    ----------
    ending : str
        With its point, in lower case.
    read : callable
        From the path, the cell size or None, and the robot's size, to a `Maze`; lengths in metres.

    Raises
    ------
    InputError
        If the ending is taken or is none.
    """
    if not re.fullmatch(r"\.[a-z0-9]+", ending):
        raise InputError(f"maze format '{ending}': expected an ending such as .maze, in lower case")
    if ending in ENDINGS or _own.setdefault(ending, read) is not read:
        raise InputError(f"maze format '{ending}': this ending is taken")


def _read(path: str, cell_m: float | None, size: RobotSize, unknown: Unknown) -> Maze:
    file, number = _scenario_number(path)
    if own := _own.get(Path(file).suffix.lower()):
        return own(file, cell_m, size)
    kind = _kind(file)
    if cell_m is not None and kind in ("yaml", "world"):
        raise InputError(f"{path}: has its own lengths, a cell size does not apply; use --scale to resize it")
    if kind == "movingai":
        return read_map(read_bytes(file, "a MovingAI map", MAX_MAP_BYTES), file, cell_m)
    if kind == "scenario":
        return _read_scenario(file, number, cell_m, size)
    if kind == "micromouse":
        return read_micromouse(read_text(file, "a micromouse maze", MAX_TEXT_BYTES), file, cell_m, size)
    if kind == "numbers":
        return read_numbers(read_text(file, "a micromouse maze", MAX_TEXT_BYTES), file, cell_m, size)
    if kind == "maz":
        return read_maz(read_bytes(file, "a micromouse maze", MAX_TEXT_BYTES), file, cell_m, size)
    if kind == "world":
        return read_world(read_text(file, "a Gazebo world", MAX_TEXT_BYTES), file)
    document = parse_yaml(read_text(file, "a maze", MAX_YAML_BYTES), file, "a maze")
    if isinstance(document.value, dict) and {"image", "resolution"} & set(document.value):
        return maze_from_map_server(document, unknown)
    return maze_from_document(document, size, unknown)


def _scenario_number(path: str) -> tuple[str, int]:
    file, mark, number = path.rpartition("#")
    if mark and file.lower().endswith(".scen"):
        if not (number.isdecimal() and 0 < len(number) < 10 and int(number) > 0):
            raise InputError(
                f"{path}: expected the scenario's number after '#', from 1, found '{number[:20]}'"
            )
        return file, int(number)
    return path, 1


def _read_scenario(file: str, number: int, cell_m: float | None, size: RobotSize) -> Maze:
    scenarios = read_scenarios(read_text(file, "a MovingAI scenario", MAX_TEXT_BYTES), file)
    if number > len(scenarios):
        raise InputError(f"{file}: has {len(scenarios)} scenarios, there is no number {number}")
    scenario = scenarios[number - 1]
    map_file = map_of(scenario, file)
    maze = read_map(read_bytes(map_file, "a MovingAI map", MAX_MAP_BYTES), str(map_file), cell_m)
    return with_scenario(maze, scenario, size)


def _kind(file: str) -> str:
    """Return the format of a file."""
    ending = Path(file).suffix.lower()
    try:
        with open(file, "rb") as stream:
            head = stream.read(HEAD_BYTES)
    except (OSError, ValueError):  # the reader of the ending's format says what is wrong
        return ENDINGS.get(ending, "yaml")
    text = head.removeprefix(BOM_UTF8).lstrip()
    first = text.split(b"\n", 1)[0].rstrip()
    if text.startswith(b"<"):
        return "world"
    if text.startswith((b"type ", b"height ")):
        return "movingai"
    if text.startswith(b"version "):
        return "scenario"
    if _POSTS.fullmatch(first):
        return "micromouse"
    if _SIX_NUMBERS.fullmatch(first):
        return "numbers"
    if len(head) == MAZ_BYTES and ending == ".maz":
        return "maz"
    if ending in ENDINGS:
        return ENDINGS[ending]
    if b":" in head and b"\0" not in head:
        return "yaml"
    raise InputError(f"{file}: not a maze of a known format (expected {KNOWN})")

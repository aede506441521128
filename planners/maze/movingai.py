"""MovingAI grid maps (.map) and scenarios (.scen), the benchmark format of grid path finding.

Passable: ``.`` and ``G`` (ground) and ``S`` (swamp); in weighted maps also digits from 1 and lower-case
letters, ground of different cost (which says nothing about a snake's speed and is not used). Everything
else that the format knows is wall: ``@`` and ``O`` (out of bounds), ``T`` (trees), ``W`` (water).
"""

from __future__ import annotations

import os
from codecs import BOM_UTF8
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planners.maze.maze import Maze
from planners.maze.places import Goal, Pose, RobotSize
from planners.maze.raster import MAX_CELLS, Raster
from planners.maze.settings import MAP_FILE
from srs_opt.errors import InputError

"""Maps have no unit of length; with this, one cell is as wide as a slim gait needs."""
PASSABLE = b".GS123456789abcdefghijklmnopqrstuvwxyz"
BLOCKED = b"@OTW"
_EXPECTED = (
    "expected a MovingAI map: lines 'type octile', 'height H', 'width W', 'map', then H rows of W cells"
)
HEADINGS = 16


def read_map(data: bytes, source: str, cell_m: float | None = None) -> Maze:
    """Return the maze of a MovingAI map, without start and goal; its lower left corner is (0, 0).

    Raises
    ------
    InputError
        Naming the line.
    """
    cell = cell_m or MAP_FILE.movingai_cell_m
    lines = data.removeprefix(BOM_UTF8).replace(b"\r\n", b"\n").split(b"\n")
    while len(lines) > 1 and not lines[-1].strip():
        lines.pop()
    height, width, first = _header(lines, source)
    rows = lines[first : first + height]
    for i, row in enumerate(rows):
        if len(row) != width:
            raise InputError(f"{source}:{first + i + 1}: {len(row)} cells, but the header says width {width}")
    if len(lines) - first != height:
        raise InputError(f"{source}: {len(lines) - first} rows of cells, but the header says height {height}")
    cells = np.frombuffer(b"".join(rows), dtype=np.uint8).reshape(height, width)
    known = np.zeros(256, dtype=bool)
    known[list(PASSABLE + BLOCKED)] = True
    odd = np.argwhere(~known[cells])
    if len(odd):
        line, column = (int(v) for v in odd[0])
        letter = ascii(chr(cells[line, column]))
        place = f"{source}:{first + line + 1}: column {column + 1}"
        raise InputError(f"{place}: unknown cell {letter} (. G S 1-9 a-z free, @ O T W wall)")
    wall = ~np.isin(np.arange(256), list(PASSABLE))
    raster = Raster(wall[cells[::-1]], cell)
    return Maze(Path(source).stem, raster.bounds(), raster=raster, source=source)


def _header(lines: list[bytes], source: str) -> tuple[int, int, int]:
    """Return height, width and the index of the first row of cells."""
    sizes: dict[str, int] = {}
    for i, line in enumerate(lines[:20]):
        words = line[:200].decode("ascii", "replace").split()
        if words == ["map"]:
            break
        if len(words) == 2 and words[0] == "type":
            continue
        if (
            len(words) != 2
            or words[0] not in ("height", "width")
            or not words[1].isdecimal()
            or len(words[1]) > 9
        ):
            raise InputError(f"{source}:{i + 1}: found {' '.join(words)[:40]!r}; {_EXPECTED}")
        sizes[words[0]] = int(words[1])
    else:
        raise InputError(f"{source}: no line 'map'; {_EXPECTED}")
    if len(sizes) < 2 or 0 in sizes.values():
        raise InputError(f"{source}: height or width is missing or zero; {_EXPECTED}")
    if sizes["height"] * sizes["width"] > MAX_CELLS:
        raise InputError(
            f"{source}: {sizes['width']} x {sizes['height']} cells are too many (limit {MAX_CELLS})"
        )
    return sizes["height"], sizes["width"], i + 1


@dataclass(frozen=True)
class Scenario:
    """One line of a scenario file: cells are counted from the upper left, lengths in cells."""

    map_name: str
    width: int
    height: int
    start: tuple[int, int]
    goal: tuple[int, int]
    optimal_length: float


def read_scenarios(text: str, source: str) -> tuple[Scenario, ...]:
    """Return the scenarios of a .scen file (headers ``version 1`` and ``version 1.0``).

    Raises
    ------
    InputError
        Naming the line.
    """
    lines = text.split("\n")
    words = lines[0].split()
    if len(words) != 2 or words[0] != "version" or words[1] not in ("1", "1.0"):
        raise InputError(f"{source}:1: found {lines[0][:40]!r}, expected 'version 1' or 'version 1.0'")
    scenarios = [_scenario(line, f"{source}:{i}") for i, line in enumerate(lines[1:], 2) if line.strip()]
    if not scenarios:
        raise InputError(
            f"{source}: no scenario in it, expected lines: bucket map width height x y x y length"
        )
    return tuple(scenarios)


def _scenario(line: str, where: str) -> Scenario:
    fields = line.split("\t") if "\t" in line else line.split()  # names may hold blanks where tabs part
    try:
        _, name, *numbers, length = (field.strip() for field in fields)
        width, height, sx, sy, gx, gy = (int(number) for number in numbers)
        scenario = Scenario(name, width, height, (sx, sy), (gx, gy), float(length))
    except ValueError as error:
        message = f"{where}: found {line.strip()[:60]!r}, expected: bucket map width height x y x y length"
        raise InputError(message) from error
    for x, y in (scenario.start, scenario.goal):
        if not (0 <= x < width and 0 <= y < height):
            raise InputError(f"{where}: cell ({x}, {y}) is outside the map of {width} x {height} cells")
    return scenario


def map_of(scenario: Scenario, source: str) -> Path:
    """Return the map file of a scenario: as named, or beside the scenario file."""
    folder = Path(source).parent
    named = scenario.map_name.replace("\\", "/")
    if "\0" in named:
        raise InputError(f"{source}: the map's name contains a null byte")
    candidates = [folder / named, folder / Path(named).name, Path(source).with_suffix("")]
    for candidate in candidates:
        if os.path.isfile(candidate):
            return candidate
    raise InputError(
        f"{source}: map {named[:80]!r} not found in {folder}; put the .map file beside the .scen file"
    )


def with_scenario(maze: Maze, scenario: Scenario, size: RobotSize) -> Maze:
    """Return the maze with a scenario's start and goal.

    A scenario has no heading: of 16 the one with most room for the straight robot is taken, of equal
    ones the nearest to the goal's direction. The goal is the disc that fits the goal cell.
    """
    assert maze.raster is not None  # read_map made it
    cell = maze.raster.cell_m
    rows, columns = maze.raster.occupied.shape
    if (columns, rows) != (scenario.width, scenario.height):
        found = (
            f"the scenario is for {scenario.width} x {scenario.height} cells, the map has {columns} x {rows}"
        )
        raise InputError(f"{maze.source}: {found}; scaled scenarios are not supported")
    (sx, sy), (gx, gy) = (
        ((x + 0.5) * cell, (rows - y - 0.5) * cell) for x, y in (scenario.start, scenario.goal)
    )
    ahead = np.arctan2(gy - sy, gx - sx)
    offsets = sorted(range(-HEADINGS // 2 + 1, HEADINGS // 2 + 1), key=abs)
    poses = [
        Pose(sx, sy, float(np.remainder(ahead + k * 2 * np.pi / HEADINGS + np.pi, 2 * np.pi) - np.pi))
        for k in offsets
    ]
    room = maze.clearances([size.straight_body(pose) for pose in poses], limit_m=10 * size.length_m)
    best = next(pose for pose, value in zip(poses, room) if value >= room.max() - 1e-9)
    return maze.with_places(best, Goal(gx, gy, radius=cell / 2))

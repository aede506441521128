"""Micromouse mazes as numbers: mms ``.num`` lines ``X Y N E S W``, and 256-byte ``.maz`` files.

Cells are counted from the lower left. In a ``.maz`` file a byte stands for a cell, column by column from
the lower left upwards; its bits 1, 2, 4, 8 are walls to the north, east, south and west. A wall that only
one of its two cells has is a wall.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planners.maze.maze import Maze
from planners.maze.micromouse import MAX_SIDE, maze_of_walls
from planners.maze.places import RobotSize
from srs_opt.errors import InputError

_EXPECTED = "expected lines X Y N E S W: a cell's column and row from the lower left, 1 for a wall, else 0"
MAZ_BYTES, MAZ_SIDE = 256, 16

Cells = list[tuple[int, int]]


def read_numbers(text: str, source: str, cell_m: float | None, size: RobotSize) -> Maze:
    """Return the maze of an mms ``.num`` file.

    Raises
    ------
    InputError
        Naming the line.
    """
    rows = [_row(line, f"{source}:{i}") for i, line in enumerate(text.split("\n"), 1) if line.strip()]
    if not rows:
        raise InputError(f"{source}: no cell in it; {_EXPECTED}")
    numbers = np.array(rows)
    columns, lines = (int(v) + 1 for v in numbers[:, :2].max(axis=0))
    if len(numbers) != columns * lines or len(np.unique(numbers[:, :2], axis=0)) != len(numbers):
        raise InputError(
            f"{source}: {len(numbers)} lines, expected one for each of {columns} x {lines} cells"
        )
    walls = np.zeros((lines, columns, 4), dtype=bool)
    walls[numbers[:, 1], numbers[:, 0]] = numbers[:, 2:] > 0
    return _maze(walls, source, cell_m, size)


def read_maz(data: bytes, source: str, cell_m: float | None, size: RobotSize) -> Maze:
    """Return the maze of a ``.maz`` file of 256 bytes."""
    cells = np.frombuffer(data, dtype=np.uint8).reshape(MAZ_SIDE, MAZ_SIDE).T
    return _maze((cells[..., None] & np.array([1, 2, 4, 8], dtype=np.uint8)) > 0, source, cell_m, size)


def _row(line: str, where: str) -> list[int]:
    words = line.split()
    numbers = [int(word) if word.isascii() and word.isdigit() and len(word) < 6 else -1 for word in words]
    if len(numbers) != 6 or min(numbers) < 0 or max(numbers[2:]) > 1:
        raise InputError(f"{where}: found '{ascii(line.strip()[:40])[1:-1]}'; {_EXPECTED}")
    if max(numbers[:2]) >= MAX_SIDE:
        raise InputError(f"{where}: cell ({numbers[0]}, {numbers[1]}) is beyond {MAX_SIDE} cells a side")
    return numbers


def _maze(walls: NDArray[np.bool_], source: str, cell_m: float | None, size: RobotSize) -> Maze:
    """Return the maze of cell walls (rows, columns, [N, E, S, W]), lowest row first."""
    rows, columns = walls.shape[:2]
    across = np.zeros((rows + 1, columns), dtype=bool)
    along = np.zeros((rows, columns + 1), dtype=bool)
    across[1:] |= walls[..., 0]
    across[:-1] |= walls[..., 2]
    along[:, 1:] |= walls[..., 1]
    along[:, :-1] |= walls[..., 3]
    middle = [range((n - 1) // 2, n // 2 + 1) for n in (rows, columns)]
    goals: Cells = [(r, c) for r in middle[0] for c in middle[1]]  # as the contest rules say
    return maze_of_walls(across, along, [(0, 0)], goals, source, cell_m, size)

"""Micromouse mazes as text: posts ``o`` or ``+``, walls ``---`` and ``|``, S start cell, G goal cells.

A classic 16 x 16 maze without S starts in the lower left corner, without G ends in the middle 2 x 2,
as the contest rules say.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planners.maze.cells import start_in_cell
from planners.maze.maze import Maze
from planners.maze.places import Box, Goal, Pose, RobotSize
from planners.maze.walls import Walls, box_shape
from srs_opt.errors import InputError

CONTEST_CELL_M = 0.18
WALL_OF_CELL = 12 / 180
"""Wall thickness over cell size."""
POSTS = "o+O."
MAX_SIDE = 1000
_EXPECTED = "expected a micromouse maze: lines like o---o---o and |   |   |"


def read_micromouse(
    text: str,
    source: str,
    cell_m: float | None = None,
    size: RobotSize | None = None,
    wall_m: float | None = None,
) -> Maze:
    """Return the maze drawn in `text`.

    Parameters
    ----------
    text : str
    source : str
        Named in complaints.
    cell_m : float, optional
        Side of a cell in metres, wall middle to wall middle (0.18 m, the contest's).
    size : RobotSize, optional
        The robot starts straight, its tail the margin away from the start cell's back wall.
    wall_m : float, optional
        Wall thickness in metres (12/180 of a cell).

    Raises
    ------
    InputError
        Naming line and column.
    """
    across, along, letters = _parse(text, source)
    starts = [(int(r), int(c)) for r, c in np.argwhere(letters == "S")]
    goals = [(int(r), int(c)) for r, c in np.argwhere(letters == "G")]
    classic = letters.shape == (16, 16)
    starts = starts or ([(0, 0)] if classic else [])
    goals = goals or ([(7, 7), (7, 8), (8, 7), (8, 8)] if classic else [])
    return maze_of_walls(across, along, starts, goals, source, cell_m, size, wall_m)


def maze_of_walls(
    across: NDArray[np.bool_],
    along: NDArray[np.bool_],
    starts: list[tuple[int, int]],
    goals: list[tuple[int, int]],
    source: str,
    cell_m: float | None = None,
    size: RobotSize | None = None,
    wall_m: float | None = None,
) -> Maze:
    """Return the maze of walls between cells.

    Parameters
    ----------
    across : ndarray of bool, shape (rows + 1, columns)
        Walls along x, lowest first.
    along : ndarray of bool, shape (rows, columns + 1)
        Walls along y.
    starts, goals : list of (row, column)
        At most one start.
    source, cell_m, size, wall_m
        As in `read_micromouse`.
    """
    cell = cell_m or CONTEST_CELL_M
    rows, columns = along.shape[0], across.shape[1]
    half = (wall_m or cell * WALL_OF_CELL) / 2
    boxes: tuple[Box, ...] = tuple((c * cell, r * cell, (c + 1) * cell, (r + 1) * cell) for r, c in goals)
    return Maze(
        name=Path(source).stem,
        bounds=(-half, -half, columns * cell + half, rows * cell + half),
        walls=_walls(across, along, cell, half),
        start=_start(across, along, starts[0], cell, half, size or RobotSize()) if starts else None,
        goal=Goal.of_boxes(boxes) if boxes else None,
        source=source,
    )


def _parse(text: str, source: str) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.str_]]:
    """Return walls across (rows+1, columns), along (rows, columns+1), and cell letters, lowest row first."""
    lines = [line.rstrip() for line in text.split("\n")]
    first = next((i for i, line in enumerate(lines) if line), len(lines))
    while lines and not lines[-1]:
        lines.pop()
    lines = lines[first:]
    width = max(map(len, lines), default=0)
    rows, columns = (len(lines) - 1) // 2, (width - 1) // 4
    if rows < 1 or columns < 1 or len(lines) != 2 * rows + 1:
        raise InputError(f"{source}: {len(lines)} lines of up to {width} characters; {_EXPECTED}")
    if max(rows, columns) > MAX_SIDE:
        raise InputError(f"{source}: {columns} x {rows} cells are too many (limit {MAX_SIDE} a side)")
    across = np.zeros((rows + 1, columns), dtype=bool)
    along = np.zeros((rows, columns + 1), dtype=bool)
    letters = np.full((rows, columns), " ", dtype="<U1")
    for i, line in enumerate(lines):
        if len(line) > 4 * columns + 1:
            raise InputError(
                f"{source}:{first + i + 1}: {len(line)} characters, expected {4 * columns + 1}; {_EXPECTED}"
            )
        line = line.ljust(4 * columns + 1)
        where = f"{source}:{first + i + 1}"
        if i % 2 == 0:
            across[rows - i // 2] = _post_line(line, where)
        else:
            along[rows - 1 - i // 2], letters[rows - 1 - i // 2] = _cell_line(line, where)
    if (letters == "S").sum() > 1:
        raise InputError(f"{source}: {(letters == 'S').sum()} start cells S, expected one")
    return across, along, letters


def _post_line(line: str, where: str) -> list[bool]:
    for k, post in enumerate(line[::4]):
        if post not in POSTS:
            raise InputError(
                f"{where}: column {4 * k + 1}: found {post!r} where a post o belongs; {_EXPECTED}"
            )
    walls = []
    for k in range(len(line) // 4):
        piece = line[4 * k + 1 : 4 * k + 4]
        if piece not in ("---", "   "):
            raise InputError(
                f"{where}: column {4 * k + 2}: found {piece!r}, expected '---' (wall) or '   ' (open)"
            )
        walls.append(piece == "---")
    return walls


def _cell_line(line: str, where: str) -> tuple[list[bool], list[str]]:
    for k, wall in enumerate(line[::4]):
        if wall not in "| ":
            raise InputError(
                f"{where}: column {4 * k + 1}: found {wall!r}, expected '|' (wall) or ' ' (open)"
            )
    letters = []
    for k in range(len(line) // 4):
        letter = line[4 * k + 1 : 4 * k + 4].strip()
        if letter not in ("", "S", "G"):
            raise InputError(
                f"{where}: column {4 * k + 3}: found {letter!r}, expected S, G or nothing in a cell"
            )
        letters.append(letter or " ")
    return [wall == "|" for wall in line[::4]], letters


def _walls(across: NDArray[np.bool_], along: NDArray[np.bool_], cell: float, half: float) -> Walls:
    """Return a box for every straight run of walls, end posts included, and one for every lone post."""
    rows, columns = along.shape[0], across.shape[1]
    boxes: list[Box] = []
    lone = np.ones((rows + 1, columns + 1), dtype=bool)
    for row in range(rows + 1):
        for first, last in _runs(across[row]):
            boxes.append((first * cell - half, row * cell - half, last * cell + half, row * cell + half))
            lone[row, first : last + 1] = False
    for column in range(columns + 1):
        for first, last in _runs(along[:, column]):
            boxes.append(
                (column * cell - half, first * cell - half, column * cell + half, last * cell + half)
            )
            lone[first : last + 1, column] = False
    for row, column in np.argwhere(lone).tolist():
        x, y = column * cell, row * cell
        boxes.append((x - half, y - half, x + half, y + half))
    return Walls.of([box_shape(box) for box in boxes])


def _runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return (first, end) of every run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _start(
    across: NDArray[np.bool_],
    along: NDArray[np.bool_],
    place: tuple[int, int],
    cell: float,
    half: float,
    size: RobotSize,
) -> Pose:
    row, column = place
    rows, columns = along.shape[0], across.shape[1]

    def run(dx: int, dy: int) -> int:
        steps, r, c = 0, row, column
        while not (along[r, c + (dx > 0)] if dx else across[r + (dy > 0), c]):
            steps, r, c = steps + 1, r + dy, c + dx
            if not (0 <= r < rows and 0 <= c < columns):
                return steps - 1  # beyond the outer line is no cell
        return steps

    x, y = column * cell, row * cell
    return start_in_cell((x + half, y + half, x + cell - half, y + cell - half), size, run)

"""Contest-like mazes of cells: perfect (one way between any two cells) and braided (with loops).

As in a micromouse contest the start is the lower left corner, closed but for its north side, and the
goal the middle 2 x 2 cells, open within and with one entrance.
"""

from __future__ import annotations

import random
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Cell = tuple[int, int]
"""Row (upwards) and column."""
Passage = frozenset[Cell]
START: Cell = (0, 0)


@dataclass(frozen=True, eq=False)
class CellMaze:
    """Walls between cells.

    Attributes
    ----------
    across : ndarray of bool, shape (rows + 1, columns)
        Horizontal walls, the lowest line first.
    along : ndarray of bool, shape (rows, columns + 1)
        Vertical walls.
    start : Cell
    goals : tuple of Cell
    """

    across: NDArray[np.bool_]
    along: NDArray[np.bool_]
    start: Cell
    goals: tuple[Cell, ...]

    def to_text(self) -> str:
        """Return the maze as micromouse text."""
        rows, columns = self.along.shape[0], self.across.shape[1]
        lines = []
        for row in range(rows, -1, -1):
            lines.append("o" + "".join(("---" if wall else "   ") + "o" for wall in self.across[row]))
            if row == 0:
                break
            line = "|" if self.along[row - 1, 0] else " "
            for column in range(columns):
                cell = (row - 1, column)
                letter = "S" if cell == self.start else "G" if cell in self.goals else " "
                line += f" {letter} " + ("|" if self.along[row - 1, column + 1] else " ")
            lines.append(line)
        return "\n".join(lines) + "\n"


def perfect(size: int, rng: random.Random, method: str = "depth-first") -> CellMaze:
    """Return a maze of `size` x `size` cells (at least 4) with exactly one way between any two.

    Parameters
    ----------
    size : int
    rng : random.Random
    method : {"depth-first", "wilson"}
        Depth-first makes long winding ways, Wilson's all mazes equally likely.
    """
    return _maze(size, _perfect_passages(size, rng, method))


def braided(size: int, rng: random.Random, braid: float = 0.5, method: str = "depth-first") -> CellMaze:
    """Return a perfect maze in which the share `braid` of the dead ends was opened into loops."""
    passages = _perfect_passages(size, rng, method)
    closed = {START, *goal_cells(size)}
    dead_ends = [cell for cell in _cells(size) if cell not in closed and _degree(cell, passages, size) == 1]
    rng.shuffle(dead_ends)
    for cell in dead_ends[: round(braid * len(dead_ends))]:
        if _degree(cell, passages, size) > 1:  # a neighbour's opening has already done it
            continue
        others = [
            n for n in _neighbours(cell, size) if n not in closed and frozenset((cell, n)) not in passages
        ]
        if others:  # opening towards another dead end does away with two
            ends = [n for n in others if _degree(n, passages, size) == 1]
            passages.add(frozenset((cell, rng.choice(ends or others))))
    return _maze(size, passages)


def goal_cells(size: int) -> tuple[Cell, ...]:
    """Return the middle cells: 2 x 2, or one when `size` is odd."""
    middle = sorted({(size - 1) // 2, size // 2})
    return tuple((row, column) for row in middle for column in middle)


def _perfect_passages(size: int, rng: random.Random, method: str) -> set[Passage]:
    goals = goal_cells(size)
    free = [cell for cell in _cells(size) if cell not in goals and cell != START]
    carve = _wilson if method == "wilson" else _depth_first
    passages = carve(free, rng, size)
    passages.add(frozenset((START, (1, 0))))
    passages |= {frozenset((a, b)) for a in goals for b in _neighbours(a, size) if b in goals}
    entrances = [(a, b) for a in goals for b in _neighbours(a, size) if b not in goals and b != START]
    passages.add(frozenset(rng.choice(entrances)))
    return passages


def _depth_first(free: list[Cell], rng: random.Random, size: int) -> set[Passage]:
    passages: set[Passage] = set()
    unvisited = set(free)
    trail = [(1, 0)]
    unvisited.discard(trail[0])
    while trail:
        choices = [cell for cell in _neighbours(trail[-1], size) if cell in unvisited]
        if not choices:
            trail.pop()
            continue
        cell = rng.choice(choices)
        passages.add(frozenset((trail[-1], cell)))
        unvisited.discard(cell)
        trail.append(cell)
    return passages


def _wilson(free: list[Cell], rng: random.Random, size: int) -> set[Passage]:
    """Return a uniformly random spanning tree: loop-erased random walks until they meet the tree."""
    passages: set[Passage] = set()
    allowed, tree = set(free), {(1, 0)}
    for first in rng.sample(free, len(free)):
        step: dict[Cell, Cell] = {}
        cell = first
        while cell not in tree:
            step[cell] = rng.choice([n for n in _neighbours(cell, size) if n in allowed])
            cell = step[cell]
        cell = first
        while cell not in tree:
            passages.add(frozenset((cell, step[cell])))
            tree.add(cell)
            cell = step[cell]
    return passages


def _maze(size: int, passages: set[Passage]) -> CellMaze:
    across = np.ones((size + 1, size), dtype=bool)
    along = np.ones((size, size + 1), dtype=bool)
    for passage in passages:
        (row, column), (row2, column2) = sorted(passage)
        if row == row2:
            along[row, column2] = False
        else:
            across[row2, column] = False
    return CellMaze(across, along, START, goal_cells(size))


def _cells(size: int) -> list[Cell]:
    return [(row, column) for row in range(size) for column in range(size)]


def _neighbours(cell: Cell, size: int) -> list[Cell]:
    row, column = cell
    around = [(row, column + 1), (row + 1, column), (row, column - 1), (row - 1, column)]
    return [(r, c) for r, c in around if 0 <= r < size and 0 <= c < size]


def _degree(cell: Cell, passages: set[Passage], size: int) -> int:
    return sum(frozenset((cell, other)) in passages for other in _neighbours(cell, size))

"""Where the straight robot starts in a cell of a grid-like maze.

Its tail is the margin away from the cell's closed back wall and it faces the cell's
opening; it may reach into the next cell.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from planners.maze.places import Box, Pose, RobotSize

DIRECTIONS = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""East, north, west, south as (column, row upwards) steps."""


def start_in_cell(inner: Box, size: RobotSize, run: Callable[[int, int], int]) -> Pose:
    """Return the start pose in a cell.

    Of several openings, one with a closed wall behind is taken, then the one with the longest
    open run, then the first of east, north, west, south. With no wall behind, the robot is centred.

    Parameters
    ----------
    inner : Box
        The cell without its walls, in metres.
    size : RobotSize
    run : callable
        ``run(dx, dy)``: how many cells are open in a row in that direction (0: closed).
    """

    def merit(step: tuple[int, int]) -> tuple[bool, int]:
        return run(-step[0], -step[1]) == 0, run(*step)

    openings = [step for step in DIRECTIONS if run(*step) > 0] or [DIRECTIONS[1]]
    dx, dy = max(openings, key=merit)
    xmin, ymin, xmax, ymax = inner
    x, y = (xmin + xmax) / 2, (ymin + ymax) / 2
    if run(-dx, -dy) == 0:
        ahead = size.margin_m + size.length_m / 2  # of the back wall's face
        if dx:
            x = xmin + ahead if dx > 0 else xmax - ahead
        else:
            y = ymin + ahead if dy > 0 else ymax - ahead
    return Pose(x, y, math.atan2(dy, dx))

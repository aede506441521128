"""Parsing of the command's own options."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planners.maze.places import Goal, Pose

MARGIN_M = 0.005  # clearance of the body from walls, where none is asked for


def pose_option(text: str) -> Pose:
    """Parse X,Y,HEADING."""
    from planners.maze.places import Pose

    return Pose(*_numbers(text, (3,), "X,Y,HEADING (m, m, rad)"))


def goal_option(text: str) -> Goal:
    """Parse X,Y[,RADIUS]."""
    from planners.maze.places import DEFAULT_GOAL_RADIUS_M, Goal

    x, y, *radius = _numbers(text, (2, 3), "X,Y or X,Y,RADIUS (m)")
    if radius and radius[0] <= 0:
        raise argparse.ArgumentTypeError(f"expected a radius above 0 m, found '{text}'")
    return Goal(x, y, radius[0] if radius else DEFAULT_GOAL_RADIUS_M)


def _numbers(text: str, counts: tuple[int, ...], expected: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(map(math.isfinite, numbers)):
        raise argparse.ArgumentTypeError(f"expected {expected}, found '{text}'")
    return numbers

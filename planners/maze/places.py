"""Where the robot starts, where it shall arrive, and how large it is."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Box = tuple[float, float, float, float]
"""xmin, ymin, xmax, ymax in metres."""

DEFAULT_GOAL_RADIUS_M = 0.05
DEFAULT_HEADING_TOLERANCE_RAD = 0.3


@dataclass(frozen=True)
class Pose:
    """Centre of mass (m) and mean heading (rad, counterclockwise from the x axis)."""

    x: float
    y: float
    heading: float

    def scaled(self, factor: float) -> Pose:
        """Return the pose of a maze `factor` times as large."""
        return Pose(self.x * factor, self.y * factor, self.heading)


@dataclass(frozen=True)
class RobotSize:
    """What the readers need to know of the robot to place it: it starts straight.

    Attributes
    ----------
    length_m : float
        Length of the straight robot, round ends included.
    half_width_m : float
        Half its body width.
    margin_m : float
        Clearance that it keeps from walls.
    """

    length_m: float = 0.236
    half_width_m: float = 0.020
    margin_m: float = 0.005

    def scaled(self, factor: float) -> RobotSize:
        """Return the size with all lengths multiplied by `factor`."""
        return RobotSize(self.length_m * factor, self.half_width_m * factor, self.margin_m * factor)

    def straight_body(self, pose: Pose) -> Any:
        """Return the shapely region of the straight robot, centre of mass and heading at `pose`."""
        import shapely

        reach = max(self.length_m / 2 - self.half_width_m, 0.0)
        dx, dy = reach * math.cos(pose.heading), reach * math.sin(pose.heading)
        spine = shapely.LineString([(pose.x - dx, pose.y - dy), (pose.x + dx, pose.y + dy)])
        return spine.buffer(self.half_width_m) if self.half_width_m > 0 else spine


@dataclass(frozen=True)
class Goal:
    """Where the centre of mass shall arrive: a disc, or the union of boxes (micromouse goal cells).

    Attributes
    ----------
    x, y : float
        Centre of the disc, or of the boxes, in metres.
    radius : float
        Radius of the disc in metres; unused with boxes.
    heading : float or None
        Wanted mean heading in rad, if any.
    heading_tolerance : float
        How far the heading may be off, in rad.
    boxes : tuple of Box
        Goal cells; when given they replace the disc.
    """

    x: float
    y: float
    radius: float = DEFAULT_GOAL_RADIUS_M
    heading: float | None = None
    heading_tolerance: float = DEFAULT_HEADING_TOLERANCE_RAD
    boxes: tuple[Box, ...] = ()

    @classmethod
    def of_boxes(cls, boxes: tuple[Box, ...]) -> Goal:
        """Return the goal "anywhere in these boxes"; its centre is the mean of theirs."""
        corners = np.asarray(boxes, dtype=float)
        x = float((corners[:, 0] + corners[:, 2]).mean() / 2)
        y = float((corners[:, 1] + corners[:, 3]).mean() / 2)
        return cls(x, y, radius=0.0, boxes=tuple(boxes))

    def distance(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return how far `points`, shape (..., 2), are from the goal region in metres (0 inside)."""
        xy = np.asarray(points, dtype=float)
        x, y = xy[..., 0], xy[..., 1]
        if not self.boxes:
            return np.maximum(np.hypot(x - self.x, y - self.y) - self.radius, 0.0)
        nearest = np.full(x.shape, np.inf)
        for xmin, ymin, xmax, ymax in self.boxes:
            dx = np.maximum(np.maximum(xmin - x, x - xmax), 0.0)
            dy = np.maximum(np.maximum(ymin - y, y - ymax), 0.0)
            nearest = np.minimum(nearest, np.hypot(dx, dy))
        return nearest

    def heading_error(self, heading: float) -> float:
        """Return by how many rad `heading` misses the tolerance (0 when it does not, or when free)."""
        if self.heading is None:
            return 0.0
        off = abs(math.remainder(heading - self.heading, 2 * math.pi))
        return max(off - self.heading_tolerance, 0.0)

    def reached(self, x: float, y: float, heading: float) -> bool:
        """Whether a robot with this centre of mass (m) and mean heading (rad) has arrived."""
        return bool(self.distance((x, y)) <= 0.0 and self.heading_error(heading) <= 0.0)

    def scaled(self, factor: float) -> Goal:
        """Return the goal of a maze `factor` times as large."""
        boxes = tuple((a * factor, b * factor, c * factor, d * factor) for a, b, c, d in self.boxes)
        return replace(self, x=self.x * factor, y=self.y * factor, radius=self.radius * factor, boxes=boxes)

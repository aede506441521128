"""Rotations and poses in the plane, in one place: numbers, arrays and CasADi expressions alike.

A pose is (x, y, heading): m, m, rad, + left. A vector (x, y) of a frame at heading psi stands in the room as
R(psi) (x, y), R(psi) = [[cos, -sin], [sin, cos]].
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def turn_by(cos: Any, sin: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Turn vectors to the left by an angle whose cosine and sine are given."""
    return cos * x - sin * y, sin * x + cos * y


def turn_back_by(cos: Any, sin: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Turn vectors to the right by an angle whose cosine and sine are given: the inverse of `turn_by`."""
    return cos * x + sin * y, cos * y - sin * x


def rotate(angle: float | np.ndarray, x: Any, y: Any) -> tuple[Any, Any]:
    """Turn vectors by `angle` (rad, to the left)."""
    return turn_by(np.cos(angle), np.sin(angle), x, y)


def rotate_back(angle: float | np.ndarray, x: Any, y: Any) -> tuple[Any, Any]:
    """Turn vectors by `angle` (rad) to the right: from the room's axes into those of a frame at `angle`."""
    return turn_back_by(np.cos(angle), np.sin(angle), x, y)


def rotation_matrix(angle: float) -> np.ndarray:
    """Return the matrix (2, 2) that turns column vectors by `angle` (rad, to the left)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


def unit_vectors(angle: np.ndarray) -> Array:
    """Return the unit vectors (..., 2) along angles (...), rad."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def quarter_turn(vectors: np.ndarray) -> Array:
    """Turn vectors (..., 2) by 90 degrees to the left: the derivative of `unit_vectors` by the angle."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)


def compose(frame: np.ndarray, local: np.ndarray) -> Array:
    """Return poses (..., 3) in the room that are `local` in a frame with pose (3,), or in several of them."""
    x, y = rotate(frame[..., 2], local[..., 0], local[..., 1])
    return np.stack([frame[..., 0] + x, frame[..., 1] + y, frame[..., 2] + local[..., 2]], axis=-1)


def relative(frame: np.ndarray, pose: np.ndarray) -> Array:
    """Return poses (..., 3) of the room as a frame with pose (3,) has them: the inverse of `compose`."""
    x, y = rotate_back(frame[2], pose[..., 0] - frame[0], pose[..., 1] - frame[1])
    return np.stack([x, y, pose[..., 2] - frame[2]], axis=-1)


def points_in_room(points: np.ndarray, pose: np.ndarray) -> Array:
    """Place points (..., n, 2) of the robot's frame at poses (..., 3)."""
    x, y = rotate(pose[..., 2, None], points[..., 0], points[..., 1])
    out = np.empty((*x.shape, 2))
    np.add(x, pose[..., 0, None], out=out[..., 0])
    np.add(y, pose[..., 1, None], out=out[..., 1])
    return out


def wrapped(angle: Any) -> Any:
    """Return angles as the same direction in [-pi, pi)."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def turn_onto(points: Any, onto: Any, axis: int | None = None) -> Any:
    """Return the angle of the best rotation (least squares) of centred points onto others.

    Both as complex numbers, where it is the argument of sum onto conj(points), over `axis` or all.
    """
    return np.angle((onto * np.conj(points)).sum(axis=axis))


def turning_angles(points: np.ndarray) -> Array:
    """Return by how much polylines of points (..., M, 2) turn at their inner points, (..., M - 2), left +."""
    chords = np.diff(points, axis=-2)
    heading = np.arctan2(chords[..., 1], chords[..., 0])
    return np.asarray(wrapped(np.diff(heading, axis=-1)))


def distance_along(points: np.ndarray) -> Array:
    """Return the distance (n,) along a polyline of points (n, 2) from the first of them, m."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])


def centre_of_rotation(displacement: np.ndarray) -> np.ndarray | None:
    """Return the fixed point of the rigid motion (dx, dy, turn), or None for a translation."""
    dx, dy, turn = displacement
    # a turn below this is rounding
    if abs(turn) < 1e-12:
        return None
    # c = (I - R)^-1 d, written with the cotangent of half the angle
    half = 1 / np.tan(turn / 2)
    return np.array([(dx - half * dy) / 2, (dy + half * dx) / 2])

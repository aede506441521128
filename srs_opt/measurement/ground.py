"""The ground plane in a take's axes: found from the motion, seen from above so that + is left."""

from __future__ import annotations

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.noise import MAD
from srs_opt.measurement.records import Array
from srs_opt.measurement.take_settings import IMPORT

UPS = {
    sign + axis: np.eye(3)[i] * (-1.0 if sign else 1.0) for i, axis in enumerate("xyz") for sign in ("", "-")
}


def ground_axes(points_m: Array, up: str = "auto") -> tuple[Array, Array]:
    """Return the two axes of the ground plane (2, 3) and the direction up (3,), a right-handed triple.

    The plane is that of least spread. A normal within `ImportSettings.snap_deg` of one of Motive's axes is
    taken to be that axis. Which side is up cannot be seen in the data: it is Motive's +Y (its default), else
    +Z, else +X.

    Parameters
    ----------
    points_m : ndarray, shape (..., 3)
        All positions; NaN where lost.
    up : str
        ``auto``, or ``x``, ``y``, ``z``, ``-x``, ``-y``, ``-z``.

    Raises
    ------
    InputError
        If `up` is unknown or there are too few positions.
    """
    if up != "auto":
        if up not in UPS:
            raise InputError(f"up: expected auto, {', '.join(UPS)}, found '{up[:20]}'")
        return _plane(UPS[up]), UPS[up]
    points = points_m.reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < 4:
        raise InputError("too few positions to find the ground plane; give it with --up")
    normal = _thinnest(points)
    nearest = int(np.argmax(np.abs(normal)))
    if abs(normal[nearest]) > np.cos(np.radians(IMPORT.snap_deg)):
        normal = np.eye(3)[nearest]
    side = next(axis for axis in (1, 2, 0) if abs(normal[axis]) > 0.1)
    # a plane's normal has no sign of its own: up is +Y, else +Z, else +X
    normal = normal * np.sign(normal[side])
    return _plane(normal), normal


def _thinnest(points: Array) -> Array:
    """Return the direction in which the positions spread least, ghosts off the plane left out."""
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    # a robust start: a few ghosts off the plane can tilt the least-squares one
    normal = min([*np.eye(3), axes[2]], key=lambda n: _spread(points @ n))
    for _ in range(10):
        height = points @ normal
        # the 1e-9 lets exact planes keep their positions
        near = np.abs(height - np.median(height)) <= 3 * max(_spread(height), 1e-9)
        _, _, axes = np.linalg.svd(points[near] - points[near].mean(axis=0), full_matrices=False)
        if abs(axes[2] @ normal) > 1 - 1e-12:
            break
        normal = axes[2]
    return np.asarray(normal)


def _spread(values: Array) -> float:
    """Return a standard deviation that a few outliers do not move."""
    return float(np.median(np.abs(values - np.median(values))) / MAD)


def without_ghosts(points_m: Array, up: Array, reach_m: float) -> Array:
    """Return the positions with those more than `reach_m` above or below the others taken out."""
    height = points_m @ up
    middle = np.median(height[np.isfinite(height)]) if np.isfinite(height).any() else 0.0
    return np.where((np.abs(height - middle) > reach_m)[..., None], np.nan, points_m)


def _plane(up: Array) -> Array:
    """Return two axes, right-handed with `up`; the first is Motive's X if it can be."""
    reference = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = reference - (reference @ up) * up
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(up, first)])


def to_ground(points_m: Array, axes: Array) -> Array:
    """Return positions (..., 3) in the ground plane (..., 2)."""
    return np.asarray(points_m @ axes.T)

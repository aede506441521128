"""Cycles bent and stretched by a drive that was calibrated from measured maps of speed and radius.

The map tells by which factors a gait's speed v and the radius R of its path are larger than the model's. A
cycle that goes along an arc of angle a then turns by a' = a v'/R' (v', R': the factors) and its chord is
R' sin(a'/2)/sin(a/2) times as long (`DriveCalibration.displacement`). Within the cycle the correction grows
evenly. The angle is that of the path, not of the mean heading, which swings with the body's shape.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from srs_opt.drive.calibration import DriveCalibration
from srs_opt.geometry import compose, distance_along, relative, turn_by

Array = NDArray[np.float64]
_STRAIGHT_RAD = 1e-6


@dataclass(frozen=True, eq=False)
class Bending:
    """Measured factors on the cycles of a gait table.

    Attributes
    ----------
    calibration : DriveCalibration
    course : array (n + 1,)
        Angle from the mean heading to the direction of travel at a cycle's end, per gait and rest.
    deviation_m : array (n + 1,), optional
        How far the body may be off after a cycle because its stiffness is (`cycle_deviation_m`).
    """

    calibration: DriveCalibration
    course: Array
    deviation_m: Array | None = None

    @property
    def none(self) -> bool:
        """Whether nothing is bent."""
        return self.calibration.speed.value == self.calibration.radius.value == 1.0

    def local(self, pose: Array, swing: Array | float, share: Array) -> Array:
        """Return poses in the frame of a cycle's start as they are measured to be.

        Parameters
        ----------
        pose : array (..., samples, 3)
            By the model; the last sample is the cycle's end.
        swing : array (...,) or float
            Course of the gait less course of the one before: what the path turns more than the heading.
        share : array (samples,)
            Of the cycle's time, 0 to 1.
        """
        speed, radius = self.calibration.speed.value, self.calibration.radius.value
        turn = pose[..., -1, 2] + swing
        more = turn * (speed / radius - 1)
        straight = np.abs(turn) < _STRAIGHT_RAD
        half = np.where(straight, 1.0, turn) / 2
        chord = np.where(straight, speed, radius * np.sin(half + more / 2) / np.sin(half))
        bent = more[..., None] * share
        c, s = chord[..., None] * np.cos(bent / 2), chord[..., None] * np.sin(bent / 2)
        return np.stack([*turn_by(c, s, pose[..., 0], pose[..., 1]), pose[..., 2] + bent], axis=-1)

    def placed(self, pose: Array, before: int, gait: int, share: Array) -> Array:
        """Return a cycle's poses (samples, 3) in the room as they are measured to be."""
        if self.none:
            return pose
        swing = float(self.course[gait] - self.course[before])
        return compose(pose[0], self.local(relative(pose[0], pose), swing, share))

    def tube_m(self, pose: Array, gait: int, most_m: float = math.inf) -> Array:
        """Return how far a cycle may be from its poses (samples, 3), measured when it begins, two sigma.

        What the stiffness's deviation does counts up to `most_m` at the cycle's end.
        """
        if self.deviation_m is None and not self.calibration.margin_m(1.0):
            return np.zeros(len(pose))
        way = distance_along(pose[:, :2])
        measured = self.calibration.margin_m(1.0) * way
        if self.deviation_m is None:
            return np.asarray(measured)
        own = min(float(self.deviation_m[gait]), most_m)
        return np.hypot(measured, own * way / max(float(way[-1]), 1e-9))

"""The robot's state from sightings: what the model predicts, corrected by what the camera has seen.

Over one cycle the model's motion P(t) is off by a constant, a drift, and the time tau by which sightings are
late beyond their stamps (camera, network, valves). Linear in all of them, with h the markers (or the pose)
and H their derivative by the pose:

    M(t_i) = h(P(t_i - tau0)) + H (a + b t_i) - (tau - tau0) dh/dt + noise.

The shape is the model's: the valves are known, and a fit of curvatures to five markers alone would leave the
mean heading uncertain by 0.05 rad (bending neighbours in opposite directions hardly moves the markers). The
body swings several millimetres sideways in every cycle, which is what makes tau visible.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from planners.pilot.pose import Sighting
from planners.pilot.settings import OBSERVER
from srs_opt.geometry import rotate_back
from srs_opt.measurement.chain import Chain, link_positions, position_jacobian
from srs_opt.model.state import FORWARD, POSE, SIDEWAYS
from srs_opt.simulate.integrate import Trajectory
from srs_opt.simulate.interpolate import linear_with_rate

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Latency:
    """The time by which sightings are late, and how well it is known."""

    value_s: float = 0.0
    sd_s: float = field(default_factory=lambda: OBSERVER.latency_s)


@dataclass(frozen=True)
class Correction:
    """What the camera says of a predicted cycle.

    Attributes
    ----------
    offset, drift : (3,) arrays
        Of x, y (m), heading (rad), and per second since the cycle's start.
    latency : Latency
    residual_m : float
        Root mean square of what is left of the places.
    misfit : float
        Sum of squares of what is left, over the noise, and of the correction over its prior: how badly the
        prediction did.
    seen : int
        Sightings used.
    """

    offset: Array
    drift: Array
    latency: Latency
    residual_m: float
    misfit: float
    seen: int

    def apply(self, motion: Trajectory) -> Trajectory:
        """Return the corrected motion, its last state included (place, heading, speed)."""
        pose = motion.pose + self.offset + self.drift * motion.time_s[:, None]
        final = motion.final.copy()
        final[POSE] = pose[-1]
        forward, sideways = rotate_back(pose[-1, 2], self.drift[0], self.drift[1])
        final[FORWARD] += forward
        final[SIDEWAYS] += sideways
        return replace(motion, pose=pose, final=final)


def correct(
    motion: Trajectory, begin_s: float, sightings: Sequence[Sighting], latency: Latency, chain: Chain
) -> Correction:
    """Fit offset, drift and latency to the sightings of a cycle.

    Parameters
    ----------
    motion : Trajectory
        Predicted, from the cycle's start.
    begin_s : float
        Its start on the pilot's clock.
    sightings : sequence of Sighting
        Those outside the motion are left out.
    latency : Latency
        As known before.
    chain : Chain
        The robot's geometry.
    """
    late = latency.value_s
    within = [s for s in sightings if 0 < s.time_s - begin_s - late < motion.time_s[-1]]
    if not within:
        return Correction(np.zeros(3), np.zeros(3), latency, 0.0, 0.0, 0)
    at = np.array([s.time_s - begin_s - late for s in within])
    configuration, rate = _interpolated(motion, at)
    blocks = [_rows(*entry, chain) for entry in zip(within, at, configuration, rate)]
    known_sd = math.hypot(latency.sd_s, OBSERVER.latency_change_s)
    prior = np.diag(1 / np.array([*OBSERVER.offset, *OBSERVER.drift, known_sd]))
    matrix = np.concatenate([*(rows for rows, _ in blocks), prior])
    wanted = np.concatenate([*(misses for _, misses in blocks), np.zeros(7)])
    found, *_ = np.linalg.lstsq(matrix, wanted, rcond=None)
    sd = math.sqrt(np.linalg.inv(matrix.T @ matrix)[6, 6])
    left = wanted - matrix @ found
    total = min(max(late + float(found[6]), -OBSERVER.longest_latency_s), OBSERVER.longest_latency_s)
    residual_m = OBSERVER.marker_m * float(np.sqrt((left[:-7] ** 2).mean()))
    return Correction(
        found[:3], found[3:6], Latency(total, sd), residual_m, float((left**2).sum()), len(within)
    )


def straight_pose(sighting: Sighting, chain: Chain, heading_rad: float) -> Array:
    """Return the pose of the straight robot that a sighting shows; `heading_rad` says which turn it is in."""
    if sighting.markers_m is None:
        assert sighting.pose is not None  # a sighting has one or the other
        pose: Array = sighting.pose.copy()
    else:
        seen = np.isfinite(sighting.markers_m[:, 0])
        along = (np.arange(chain.links) - (chain.links - 1) / 2)[seen] * chain.pitch_m
        centre = sighting.markers_m[seen].mean(axis=0)
        # the least squares direction of points at known places along a line
        x, y = (along - along.mean()) @ (sighting.markers_m[seen] - centre)
        heading = math.atan2(y, x)
        back = along.mean()
        pose = np.array([centre[0] - back * math.cos(heading), centre[1] - back * math.sin(heading), heading])
    pose[2] = _in_turn(pose[2], heading_rad)
    return pose


def _in_turn(angle: float, near: float) -> float:
    return near + (angle - near + math.pi) % (2 * math.pi) - math.pi


def _rows(
    sighting: Sighting, at_s: float, configuration: Array, rate: Array, chain: Chain
) -> tuple[Array, Array]:
    """Return one sighting's rows of the linear problem, shape (m, 7), and its misses, both over the noise."""
    if sighting.markers_m is None:
        assert sighting.pose is not None  # a sighting has one or the other
        measured = sighting.pose.copy()
        measured[2] = _in_turn(measured[2], configuration[2])
        misses, by_pose, speed = measured - configuration[:3], np.eye(3), rate[:3]
        sd = np.array(OBSERVER.pose)
    else:
        jacobian = position_jacobian(chain, configuration).reshape(-1, chain.unknowns)
        misses = (sighting.markers_m - link_positions(chain, configuration)).ravel()
        seen = np.isfinite(misses)
        jacobian, misses = jacobian[seen], misses[seen]
        by_pose, speed = jacobian[:, :3], jacobian @ rate
        sd = np.full(misses.size, OBSERVER.marker_m)
    rows = np.column_stack([by_pose, by_pose * at_s, -speed])
    return rows / sd[:, None], misses / sd


def _interpolated(motion: Trajectory, at: Array) -> tuple[Array, Array]:
    """Return configurations (pose, curvatures) and their rates within the motion, linear between nodes."""
    whole = np.concatenate([motion.pose, motion.kappa], axis=1)
    return linear_with_rate(motion.time_s, whole, at)

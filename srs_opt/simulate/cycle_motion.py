"""The rigid motion of a cycle: speed, turn rate, radius, envelope."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from srs_opt.geometry import centre_of_rotation, quarter_turn, unit_vectors
from srs_opt.simulate.settings import MOTION


@dataclass(frozen=True)
class CycleMotion:
    """Steady motion over one cycle.

    Attributes
    ----------
    displacement : array (3,)
        Rigid displacement per cycle (x, y in m in the frame of the cycle's start, turn in rad).
    speed_m_s : float
        |turn rate| x radius (straight: displacement over period); negative when the robot backs up.
    turn_rate_rad_s : float
        Positive to the left.
    radius_m : float or None
        Mean distance of the centre of mass from the cycle's centre of rotation; positive with the centre on
        the left of the travel's heading (speed = turn rate x radius); None when straight.
    envelope_m : (right, left)
        Reach of the body to either side of the mean path, body width included, m.
    """

    displacement: np.ndarray
    speed_m_s: float
    turn_rate_rad_s: float
    radius_m: float | None
    envelope_m: tuple[float, float]


def cycle_motion(
    time_s: np.ndarray, pose: np.ndarray, outline_x: np.ndarray, outline_y: np.ndarray, body_width_m: float
) -> CycleMotion:
    """Return the steady motion of a cycle from poses and body points at times 0 ... period.

    Parameters
    ----------
    time_s : array (n,)
    pose : array (n, 3)
        Centre of mass and mean heading, starting at (0, 0, any).
    outline_x, outline_y : array (points, n)
        Centre line of the body in the room.
    body_width_m : float
    """
    period = time_s[-1]
    displacement = pose[-1] - pose[0]
    dx, dy, turn = displacement
    # means over the cycle, by the trapezoidal rule: the nodes are not evenly spaced
    weights = np.gradient(time_s)
    weights[[0, -1]] = (time_s[1] - time_s[0]) / 2, (time_s[-1] - time_s[-2]) / 2
    weights /= weights.sum()
    centre = centre_of_rotation(displacement)
    heading = float(weights @ pose[:, 2])
    half_width = body_width_m / 2
    if centre is not None:
        centre = centre + pose[0, :2]
        distance = np.hypot(pose[:, 0] - centre[0], pose[:, 1] - centre[1])
        radius = float(weights @ distance)
        if radius <= MOTION.straight_radius_m:
            reach = np.hypot(outline_x - centre[0], outline_y - centre[1])
            # the smallest distance as the largest of the negative, so that its peak is interpolated too
            outside, inside = largest(reach) - radius + half_width, radius + largest(-reach) + half_width
            forward = _forward(displacement, pose, heading, centre, weights)
            speed = forward * abs(turn) / period * radius
            side = np.sign(turn) * forward  # centre on the left of the heading: +1
            envelope = (outside, inside) if side > 0 else (inside, outside)
            return CycleMotion(
                displacement, float(speed), float(turn / period), float(side * radius), _floats(envelope)
            )
    distance_m = float(np.hypot(dx, dy))
    ahead = unit_vectors(np.asarray(heading))
    forward = 1.0 if ahead @ displacement[:2] >= 0 else -1.0
    along = np.array([dx, dy]) / distance_m * forward if distance_m > 1e-9 else ahead
    middle = weights @ pose[:, :2]
    lateral = along[0] * (outline_y - middle[1]) - along[1] * (outline_x - middle[0])
    envelope = (half_width + largest(-lateral), half_width + largest(lateral))
    return CycleMotion(
        displacement, forward * distance_m / float(period), float(turn / period), None, _floats(envelope)
    )


def largest(values: np.ndarray) -> float:
    """Return the largest value of curves (n, instants) over a cycle, the last instant being the first again.

    Parabolas through each curve's largest sample and its neighbours: the samples alone miss a peak by up to
    0.5 mm, by how much depends on the cycle's time 0.
    """
    cycle = values[:, :-1]
    row, k, count = np.arange(len(cycle)), cycle.argmax(axis=1), cycle.shape[1]
    before, peak, after = (cycle[row, (k + d) % count] for d in (-1, 0, 1))
    # the vertex of a parabola through three samples a step apart
    second = 2 * peak - before - after
    rise = np.divide((after - before) ** 2, 8 * second, out=np.zeros(len(cycle)), where=second > 0)
    return float((peak + rise).max())


def _forward(
    displacement: np.ndarray, pose: np.ndarray, heading: float, centre: np.ndarray, weights: np.ndarray
) -> float:
    """Return +1 if the mean motion runs along the mean heading, -1 if against it."""
    middle = weights @ pose[:, :2]
    arm = middle - centre
    # the velocity of a rotation, e_z x arm times its sense
    travel = np.sign(displacement[2]) * quarter_turn(arm)
    return 1.0 if travel @ unit_vectors(np.asarray(heading)) >= 0 else -1.0


def _floats(pair: tuple[float, float]) -> tuple[float, float]:
    return float(pair[0]), float(pair[1])

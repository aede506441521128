"""The body over a cycle of a steady gait, in the room."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from srs_opt.geometry import rotate
from srs_opt.orbit.settings import ENVELOPE
from srs_opt.robot import Robot
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.interpolate import linear
from srs_opt.simulate.shapes import centre_lines


@lru_cache(maxsize=64)
def integrator(robot: Robot, model: str | None = None) -> Integrator:
    """Return the integrator of a robot without effects that know the room (they have no steady gait)."""
    return Integrator(robot, model, room=False)


def body_over_cycle(
    run: Integrator,
    time_s: np.ndarray,
    pose: np.ndarray,
    kappa: np.ndarray,
    samples: int | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return times (samples,), poses (samples, 3) and centre lines x, y (points, samples) in the room.

    Without a number of samples, `ENVELOPE.samples`.
    """
    at = np.linspace(0.0, time_s[-1], samples or ENVELOPE.samples)
    poses, kappas = linear(time_s, pose, at), linear(time_s, kappa, at)
    x, y = centre_lines(run, kappas).T
    room_x, room_y = rotate(poses[:, 2], x, y)
    return at, poses, room_x + poses[:, 0], room_y + poses[:, 1]

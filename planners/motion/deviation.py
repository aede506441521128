"""How far a cycle may end from where it should because the body's stiffness is known with a deviation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from srs_opt.errors import NoAnswerError
from srs_opt.gait_opt.robust import stiffness_interval
from srs_opt.gait_opt.table import GaitTable
from srs_opt.orbit.steady import steady_gaits
from srs_opt.robot import Robot

Array = NDArray[np.float64]


def cycle_deviation_m(robot: Robot, table: GaitTable) -> Array | None:
    """Return how far any point of the body may be off after a cycle of each gait and of rest (n + 1,).

    That is the distance between the steady cycle and those at either end of the stiffness's interval, two
    standard deviations away (`stiffness_interval`); a turn moves head and tail by half the body's length. A
    gait that has no steady motion at one of them may be off by its whole way and a body length. None for a
    robot whose stiffness has no deviation.
    """
    others = stiffness_interval(robot)[1:]
    if not others:
        return None
    wanted = np.array([entry.displacement for entry in table.gaits])
    off = np.zeros(len(wanted) + 1)
    lost = np.hypot(wanted[:, 0], wanted[:, 1]) + robot.length_m
    for other in others:
        orbits = steady_gaits(other, [entry.gait for entry in table.gaits], table.model)
        for k, orbit in enumerate(orbits):
            if isinstance(orbit, NoAnswerError):
                off[k] = lost[k]
            else:
                dx, dy, turn = orbit.motion.displacement - wanted[k]
                off[k] = max(off[k], float(np.hypot(dx, dy) + abs(turn) * robot.length_m / 2))
    return off

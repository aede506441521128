"""Coming to rest: vent at once, or brake with another gait for a cycle first, whatever leaves more room.

A vented body straightens while it rolls on, which may be what touches a nearby wall.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planners.drive.friction_ensemble import FrictionEnsemble
from srs_opt.model.state import FORWARD
from srs_opt.simulate.timeline import Timeline


def halt(ensemble: FrictionEnsemble, state: NDArray[np.float64], before: int) -> Timeline:
    """Return the valves' timeline that brings the robot to rest farthest from the walls.

    Parameters
    ----------
    ensemble : FrictionEnsemble
    state : array
        Of the planned robot's model; forward speed in entry 3.
    before : int
        Gait of the cycle that ends now, or rest.
    """
    problem = ensemble.problem
    joints, coast_s = problem.joints, ensemble.settings.coast_s
    vent = joints.vent(before, coast_s)
    best, most_m = vent, ensemble.least_room_m(state, vent)
    forward = float(state[FORWARD]) > 0
    possible = np.flatnonzero(problem.motion.may_follow(before))
    ahead = np.array([entry.speed_m_s > 0 for entry in problem.gaits.gaits]) == forward
    brakes, steers = possible[~ahead[possible]], possible[ahead[possible]]
    # braking for one cycle, then for two, then steering away: what is looked at last goes farthest
    for gaits, cycles in ((brakes, 1), (brakes, 2), (steers, 1)):
        if most_m >= ensemble.enough_m:
            break
        for gait in map(int, gaits):
            first, more = joints.timeline(before, gait), joints.timeline(gait, gait)
            way = Timeline.join([first, *[more] * (cycles - 1), joints.vent(gait, coast_s)])
            room_m = ensemble.least_room_m(state, way, most_m)
            if room_m > most_m:
                best, most_m = way, room_m
    return best

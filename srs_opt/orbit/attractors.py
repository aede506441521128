"""Other stable orbits of the same gait: a soft body can run at one speed from rest, at another when rolling.

There is no list of all orbits of a nonlinear system: the gait is started from several motions, and what they
settle into is compared. Finding none is evidence, not proof.
"""

from __future__ import annotations

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.orbit.actuators import periodic_actuators
from srs_opt.orbit.body import integrator
from srs_opt.orbit.settings import ATTRACTOR
from srs_opt.orbit.solve import Cycle, reached_from
from srs_opt.orbit.steady import Orbit, orbit_of
from srs_opt.robot import Robot
from srs_opt.simulate.batched import run_batched


def other_orbits(robot: Robot, orbit: Orbit, model: str | None = None) -> list[Orbit]:
    """Return stable orbits of the same gait that rolling starts lead to and a standing start does not.

    Parameters
    ----------
    orbit : Orbit
        The one reached from rest (`srs_opt.orbit.steady.steady_gait`).

    Returns
    -------
    list of Orbit
        Fastest first; empty for models that prescribe the curvature, which have one orbit.
    """
    run, gait = integrator(robot, model), orbit.gait
    if not run.structure.compliant:
        return []
    cycle = Cycle.of(run, gait)
    # the body starts bent as it would be without load
    bends = periodic_actuators(run, gait, cycle.p)[: 2 * robot.segments]
    pace = robot.segments * robot.pitch_m / gait.period_s
    starts = [np.concatenate([[share * pace, 0.0, 0.0], bends]) for share in ATTRACTOR.starts]
    same_m_s = ATTRACTOR.same * robot.length_m
    found: list[Orbit] = []
    for solution in run_batched([reached_from(run, gait, start) for start in starts]):
        if isinstance(solution, NoAnswerError):
            continue
        other = orbit_of(run, gait, solution)
        if all(cycle.size(other.dynamic - known.dynamic) > same_m_s for known in (orbit, *found)):
            found.append(other)
    return sorted(found, key=lambda o: -o.speed_m_s)

"""What room the body will have, simulated with the friction that the driven robot seems to have.

Whatever slows a robot down or lets it slide is seen as friction: after every cycle, those frictions stay
possible that would have led near to where the robot is. What the driver thinks of doing is looked at with all
of them.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from planners.drive.contact import BodyWatch
from planners.motion.robots import undelayed, with_friction_times
from planners.search.problem import Problem
from srs_opt.errors import NoAnswerError
from srs_opt.orbit.steady import integrator
from srs_opt.simulate.integrate import Trajectory
from srs_opt.simulate.timeline import Timeline
from srs_opt.simulate.together import together

Array = NDArray[np.float64]
# friction along and across the wheels, over the planned robot's; a hose that drags is felt along the wheels
FRICTIONS = ((1.0, 1.0), (0.8, 0.8), (1.2, 1.2), (0.8, 1.0), (1.25, 1.0), (1.5, 1.0), (2.0, 1.0))
FADING = 0.7  # of what earlier cycles told, per cycle
# misses of place (m), heading (rad) and speed (m/s) that weigh alike
SCALES = np.array([0.01, 0.01, 0.05, 0.05])
# a friction is thought possible up to this squared miss, and so many times the least one
PLAUSIBLE, TIMES = 1.0, 3.0
ENOUGH_MARGINS = 0.5  # of the margin: what leaves so much room is good enough


class Foresight:
    """Simulates what the driver thinks of doing, with every friction that the true robot may have.

    Parameters
    ----------
    problem : Problem
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        robot = problem.robot
        self._runs = [
            integrator(undelayed(with_friction_times(robot, *friction)), problem.gaits.model)
            for friction in FRICTIONS
        ]
        self._misses = np.zeros(len(FRICTIONS))

    @property
    def enough_m(self) -> float:
        """Clearance that is good enough."""
        return ENOUGH_MARGINS * self.problem.margin_m

    @property
    def likely(self) -> tuple[float, float]:
        """The one of FRICTIONS that explains best what was seen."""
        return FRICTIONS[int(self._misses.argmin())]

    def learn(self, before: Array, timeline: Timeline, after: Array) -> None:
        """Take in one cycle: the state it began with and the state it ended with."""
        foreseen = together([run.travel(timeline, before) for run in self._runs])
        misses = [_miss(outcome, after) for outcome in foreseen]
        self._misses = FADING * self._misses + misses

    def room_m(self, state: Array, timeline: Timeline, friction: int | None = None) -> float:
        """Return the smallest clearance with the likeliest friction, or another of FRICTIONS.

        Minus infinity where the model cannot go on.
        """
        run = self._runs[FRICTIONS.index(self.likely) if friction is None else friction]
        try:
            trajectory = run.run(timeline, state)
        except NoAnswerError:
            return -math.inf
        watch = BodyWatch(self.problem, self.problem.robot, run)
        watch.look(trajectory.time_s, trajectory.pose, trajectory.kappa, ends=False)
        return watch.smallest_m

    def least_room_m(self, state: Array, timeline: Timeline, worth_m: float = -math.inf) -> float:
        """Return the smallest clearance with any friction; given up at one that leaves at most `worth_m`."""
        least_m = math.inf
        possible = self._misses <= PLAUSIBLE + TIMES * self._misses.min()
        for friction in np.argsort(self._misses, kind="stable"):
            if possible[friction]:
                least_m = min(least_m, self.room_m(state, timeline, int(friction)))
            if least_m <= worth_m:
                break
        return least_m


def _miss(foreseen: Trajectory | NoAnswerError, after: Array) -> float:
    """Return how far a cycle ends from where it did, squared; infinity where the model could not go on."""
    if isinstance(foreseen, NoAnswerError):
        return math.inf
    off = foreseen.final[:4] - after[:4]
    off[2] = (off[2] + math.pi) % (2 * math.pi) - math.pi
    return float(((off / SCALES) ** 2).sum())

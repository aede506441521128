"""What room the body will have, simulated on the planned robot and on others that differ from it a little."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from planners.drive.contact import BodyWatch
from planners.motion.robots import undelayed
from planners.search.problem import Problem
from srs_opt.errors import NoAnswerError
from srs_opt.orbit.steady import integrator
from srs_opt.simulate.timeline import Timeline

ROUGHNESS = (1.0, 0.8, 1.2)  # friction over the planned robot's


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
            integrator(
                undelayed(
                    robot.with_values(
                        friction_tangential=share * robot.friction_tangential,
                        friction_normal=share * robot.friction_normal,
                    )
                ),
                problem.gaits.model,
            )
            for share in ROUGHNESS
        ]

    def room_m(self, state: NDArray[np.float64], timeline: Timeline, model: int = 0) -> float:
        """Return the smallest clearance with one friction; minus infinity where the model cannot go on."""
        run = self._runs[model]
        try:
            trajectory = run.run(timeline, state)
        except NoAnswerError:
            return -math.inf
        watch = BodyWatch(self.problem, self.problem.robot, run)
        watch.look(trajectory.time_s, trajectory.pose, trajectory.kappa, ends=False)
        return watch.smallest_m

    def least_room_m(
        self, state: NDArray[np.float64], timeline: Timeline, worth_m: float = -math.inf
    ) -> float:
        """Return the smallest clearance with any friction; given up at one that leaves at most `worth_m`."""
        least_m = math.inf
        for model in range(len(self._runs)):
            least_m = min(least_m, self.room_m(state, timeline, model))
            if least_m <= worth_m:
                break
        return least_m

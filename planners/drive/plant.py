"""The robot that is driven: simulated here, or a real one behind a line and a camera (planners.pilot)."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from planners.motion.robots import undelayed
from planners.search.problem import Problem
from srs_opt.robot import Robot
from srs_opt.simulate.integrate import Integrator, Trajectory
from srs_opt.simulate.timeline import Timeline

Array = NDArray[np.float64]


class PlantStopped(Exception):
    """The robot has been vented and stands still.

    Attributes
    ----------
    reason : str
        In words.
    may_go_on : bool
        Whether another way may be tried from where it stands.
    """

    def __init__(self, reason: str, may_go_on: bool) -> None:
        super().__init__(reason)
        self.reason, self.may_go_on = reason, may_go_on


class Plant(Protocol):
    """What is driven.

    Attributes
    ----------
    waits : bool
        Whether time stands still between two motions, as in a simulation.
    lost : str
        Why the robot must halt for good, if it must.
    robot : Robot
        For its body's width and valve delay.
    run : Integrator
        Of that robot, for the shape of its body.
    state : array
        Now, or where the last motion will have ended, as the planned robot's model has it.
    """

    waits: bool
    lost: str
    robot: Robot
    run: Integrator
    state: Array

    def play(self, timeline: Timeline, gait: int | None) -> Trajectory:
        """Play valves from now on; return the motion. `gait`: the table's, if it is its own cycle."""


class SimulatedPlant:
    """A robot's full dynamic model, from rest at the problem's start.

    Commands reach its valves late by a constant; that delay is waited once, before the first cycle.
    """

    waits, lost = True, ""

    def __init__(self, problem: Problem, robot: Robot) -> None:
        self.robot = robot
        self.run = Integrator(undelayed(robot), _model(problem, robot))
        start = problem.start
        self._problem = problem
        self._state = self.run.rest(start.x, start.y, start.heading)
        self.state = problem.as_planned(self._state, self.run)

    def play(self, timeline: Timeline, gait: int | None) -> Trajectory:
        """Integrate the model over the timeline."""
        trajectory = self.run.integrate(timeline, self._state)
        self._state = trajectory.final
        self.state = self._problem.as_planned(self._state, self.run)
        return trajectory


def _model(problem: Problem, robot: Robot) -> str:
    """Return the model that drives: the plan's, but a robot that is softer or stiffer has its own."""
    planned = problem.gaits.model
    if robot.is_soft == problem.robot.is_soft and not (planned == "compliant" and not robot.is_soft):
        return planned
    return robot.own_model

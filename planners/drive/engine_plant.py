"""The driven robot in another physics engine, walls included."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dart_snake.bending import Lags, respond
from dart_snake.engine import STEP_S, Motion, Snake
from planners.drive.execute import Drive, Execution
from planners.drive.settings import DEFAULT_DRIVE
from planners.motion.robots import undelayed
from planners.plan.answer import Plan
from planners.search.problem import Problem
from planners.view.record import maze_record
from srs_opt.geometry import rotate_back
from srs_opt.judge.bodies import body_of, check_engine, drive_of, pull_of, slope_of
from srs_opt.judge.walls import boxes_of
from srs_opt.model.state import FORWARD, SIDEWAYS, YAW_MOMENTUM
from srs_opt.robot import Robot
from srs_opt.simulate.integrate import Integrator, Trajectory
from srs_opt.simulate.timeline import Timeline

Array = NDArray[np.float64]


class EnginePlant:
    """A robot in the engine, from rest at the problem's start, among the maze's walls.

    Attributes
    ----------
    contacts : int
        How often the body has come to touch a wall.
    """

    waits, lost = True, ""

    def __init__(self, problem: Problem, robot: Robot) -> None:
        self.robot = robot
        self.run = Integrator(undelayed(robot), problem.gaits.model)
        start = problem.start
        self._snake = Snake(
            body_of(robot), (start.x, start.y, start.heading), walls=boxes_of(maze_record(problem.maze)),
            slope=slope_of(robot), pull=pull_of(robot, room=True),
        )  # fmt: skip
        self._lags, self._rate = Lags.rest(robot.segments), np.zeros(robot.segments)
        self._touching, self.contacts = False, 0
        self.state = self._state(self._snake.look())

    def play(self, timeline: Timeline, gait: int | None) -> Trajectory:
        """Play the valves of a timeline in the engine."""
        duration = timeline.end_s
        steps = max(math.ceil(duration / STEP_S - 1e-9), 1)
        self._snake.step_s = duration / steps
        drive = drive_of(self.robot, timeline.valve, timeline.pressure_kpa, timeline.frequency_hz)
        times = np.asarray(np.arange(1, steps + 1) * (duration / steps), dtype=np.float64)
        tau = (self.robot.tau1_s, self.robot.tau2_s)
        before = self._snake.look()
        curvature, rate, self._lags = respond(self._lags, timeline.duration_s, drive, tau, times)
        seen = self._snake.play(curvature, rate, DEFAULT_DRIVE.engine_steps)
        self._rate = rate[-1]
        for touched in seen.touched:
            self.contacts += bool(touched and not self._touching)
            self._touching = bool(touched)
        self.state = self._state(seen)
        return self._trajectory(before, seen)

    def _state(self, seen: Motion) -> Array:
        """Return the model's state that the engine's last row stands for."""
        layout, mass = self.run.layout, np.array([link.mass_kg for link in self._snake.body.links])
        pose = _poses(seen, mass)[-1]
        state = self.run.rest(float(pose[0]), float(pose[1]), float(pose[2]))
        velocity, turning = self._snake.link_velocities(), self._snake.turn_rates()
        own = mass @ velocity / mass.sum()
        state[FORWARD], state[SIDEWAYS] = rotate_back(pose[2], own[0], own[1])
        arm = np.stack([seen.x_m[-1], seen.y_m[-1]], axis=1) - pose[:2]
        inertia = np.array([link.inertia_kg_m2 for link in self._snake.body.links])
        state[YAW_MOMENTUM] = (
            mass @ (arm[:, 0] * velocity[:, 1] - arm[:, 1] * velocity[:, 0]) + inertia @ turning
        )
        state[layout.kappa] = seen.bend_rad[-1] / self.robot.segment_length_m
        state[layout.dkappa] = np.diff(turning) / self.robot.segment_length_m
        n, first = self.robot.segments, layout.actuator.start
        state[first : first + n], state[first + n : first + 2 * n] = self._lags.curvature, self._rate
        return state

    def _trajectory(self, before: Motion, seen: Motion) -> Trajectory:
        mass = np.array([link.mass_kg for link in self._snake.body.links])
        time_s = np.concatenate([before.time_s, seen.time_s]) - before.time_s[0]
        pose = np.concatenate([_poses(before, mass), _poses(seen, mass)])
        bend = np.concatenate([before.bend_rad, seen.bend_rad]) / self.robot.segment_length_m
        rate = np.gradient(bend, time_s, axis=0)
        still: dict[str, Any] = {
            "velocity": np.zeros_like(pose),
            "work_j": np.zeros_like(time_s),
            "error_m_s": np.zeros(time_s.size - 1),
        }
        return Trajectory(
            time_s=time_s, pose=pose, kappa=bend, dkappa=rate, no_load=bend, no_load_rate=rate,
            final=self.state, **still,
        )  # fmt: skip


def _poses(seen: Motion, mass: Array) -> Array:
    """Return centre of mass and mean heading, (T, 3)."""
    share = mass / mass.sum()
    return np.stack([seen.x_m @ share, seen.y_m @ share, seen.theta_rad.mean(axis=1)], axis=1)


@dataclass(frozen=True)
class EngineDrive:
    """A closed-loop drive with the engine as the robot, and how often its body touched a wall there."""

    execution: Execution
    contacts: int

    @property
    def agrees(self) -> bool:
        """Whether the robot arrived without contact."""
        return self.execution.reached and not self.contacts

    def to_record(self) -> dict[str, Any]:
        """Return the `judge` entry of the command's JSON."""
        e = self.execution
        return {
            "engine": "DART",
            "reached": e.reached,
            "contacts": self.contacts,
            "smallest_clearance_m": round(e.smallest_clearance_m, 6),
            "final_error_m": round(e.final_error_m, 6),
            "duration_s": round(e.duration_s, 4),
            "replans": e.replans,
            "reason": e.reason,
            "agrees": self.agrees,
        }


def drive_in_engine(
    problem: Problem,
    plan: Plan,
    robot: Robot | None = None,
    tell: Callable[[str], None] = lambda message: None,
) -> EngineDrive:
    """Drive `plan` closed-loop with `robot` (default: the planned one) in the engine.

    Raises
    ------
    InputError
        If the engine is missing or cannot stand for the robot.
    """
    check_engine()
    plant = EnginePlant(problem, robot or problem.robot)
    execution = Drive(problem, plan, plant, tell).go()
    return EngineDrive(execution, plant.contacts)

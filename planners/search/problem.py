"""One planning problem: robot, gaits, maze, and everything that is worked out once for them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planners.maze.field import DistanceField
from planners.maze.maze import Maze
from planners.maze.places import Goal, Pose, RobotSize
from planners.motion.bending import Bending
from planners.motion.cycles import CycleRun
from planners.motion.robots import undelayed
from planners.motion.table import MotionTable
from planners.motion.valves import Joints
from planners.search.clearance import BodyClearance
from planners.search.cost_model import Cost, CostModel
from planners.search.costmap import CostMap, cost_map, slowness, speed_by_room
from planners.search.heading_map import HeadingMap, heading_map
from planners.search.settings import RESOLUTION
from srs_opt.drive.calibration import NO_CALIBRATION, DriveCalibration
from srs_opt.errors import NoAnswerError
from srs_opt.gait_opt.table import GaitTable
from srs_opt.geometry import points_in_room
from srs_opt.model.state import POSE
from srs_opt.orbit.body import integrator
from srs_opt.robot import Robot
from srs_opt.simulate.batched import run_batched
from srs_opt.simulate.integrate import Integrator, Trajectory
from srs_opt.simulate.shapes import centre_lines

Array = NDArray[np.float64]
ROUNDING_M = 1e-6  # that a clearance may miss the margin by


@dataclass(frozen=True)
class Cycle:
    """One simulated cycle.

    Attributes
    ----------
    state : array
        State at its end.
    pose : array (SAMPLES + 1, 3)
    lines : array (SAMPLES + 1, points, 2)
        Centre line of the body in the room.
    tube_m : float
        How far its end may be from where it is said to be, when it is measured where it begins.
    """

    state: Array
    pose: Array
    lines: Array
    tube_m: float = 0.0


@dataclass(frozen=True, eq=False)
class Problem:
    """What a planner is given.

    Attributes
    ----------
    robot : Robot
    gaits : GaitTable
    motion : MotionTable
    maze : Maze
        With start and goal.
    margin_m : float
    cost : {"time", "length", "clearance", "air"}
        What shall be small.
    drive : DriveCalibration
        Measured factors; `motion` is bent by them already (`MotionTable.bent`).
    fine : bool
        Simulate with half the step and measure by a finer field of distances; see `finer`.
    """

    robot: Robot
    gaits: GaitTable
    motion: MotionTable
    maze: Maze
    margin_m: float
    cost: Cost = "time"
    drive: DriveCalibration = NO_CALIBRATION
    fine: bool = False

    def __getstate__(self) -> dict[str, object]:
        """Only what was given goes to other processes: what was worked out may hold compiled code."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def start(self) -> Pose:
        """Where the robot starts, straight and at rest."""
        assert self.maze.start is not None
        return self.maze.start

    @property
    def goal(self) -> Goal:
        """Where it shall arrive."""
        assert self.maze.goal is not None
        return self.maze.goal

    @cached_property
    def field(self) -> DistanceField:
        """Distances to walls."""
        if not self.fine:
            return DistanceField.of(self.maze, finest_m=RESOLUTION.field * self.robot.length_m)
        xmin, ymin, xmax, ymax = self.maze.bounds
        least_m = math.sqrt((xmax - xmin) * (ymax - ymin) / RESOLUTION.fine_nodes)
        return DistanceField.of(self.maze, max(RESOLUTION.fine_field * self.robot.length_m, least_m))

    @cached_property
    def finer(self) -> Problem:
        """The same problem for searches where millimetres decide: shorter steps, a finer distance field."""
        finer = replace(self, fine=True)
        finer.__dict__["integrator"] = self.integrator  # compiled already
        finer.__dict__["to_goal"] = self.to_goal
        return finer

    @cached_property
    def body(self) -> BodyClearance:
        """Clearance of bodies."""
        return BodyClearance(self.maze, self.field, self.robot.body_width_m / 2, self.margin_m)

    @cached_property
    def to_goal(self) -> CostMap:
        """Cost of the way to the goal (time, where time counts)."""
        return cost_map(self.field, self.goal, self.gaits, self.robot.body_width_m / 2, self._per_metre)

    def _per_metre(self, in_time: Array, room: Array) -> Array:
        return self.cost_model.per_metre(in_time, room - self.robot.body_width_m / 2 - self.margin_m)

    @cached_property
    def to_goal_by_heading(self) -> HeadingMap:
        """Cost of the way to the goal by place, course and direction of travel."""
        half, start = self.robot.body_width_m / 2, self.start
        radius = 0.1 * self.robot.length_m
        from_start = cost_map(self.field, Goal(start.x, start.y, radius), self.gaits, half, self._per_metre)
        least = float(self.to_goal.at(np.array([start.x, start.y])))
        detour = RESOLUTION.detour * self.robot.length_m / self.cost_model.top_speed_m_s

        def near_the_way(nodes: Array) -> NDArray[np.bool_]:
            cost = self.to_goal.at(nodes) + from_start.at(nodes)
            return cost < RESOLUTION.detour_times * least + detour

        def cost_per_metre(room: Array) -> Array:
            return self._per_metre(slowness(room, *speed_by_room(self.gaits)), room)

        return heading_map(
            self.field,
            self.goal,
            self.gaits,
            half + self.margin_m,
            cost_per_metre,
            self.cost_model.start_up,
            near_the_way,
        )

    @cached_property
    def cost_model(self) -> CostModel:
        """Costs of the gaits."""
        return CostModel.of(self.cost, self.robot, self.gaits)

    @cached_property
    def start_slack_m(self) -> float:
        """By how much the straight body at the start clears the margin; not above 0, rounding taken off."""
        size = RobotSize(self.robot.length_m, self.robot.body_width_m / 2, self.margin_m)
        clearance = self.maze.clearance(size.straight_body(self.start))
        return min(clearance - self.margin_m, 0.0) - ROUNDING_M

    @cached_property
    def integrator(self) -> Integrator:
        """The dynamic model, without effects that know the room and without the valves' delay."""
        return integrator(undelayed(self.robot), self.gaits.model)

    @cached_property
    def bending(self) -> Bending:
        """What measured factors do to a cycle of the model."""
        return Bending(self.drive, self.motion.course, self.motion.deviation_m)

    def tube_m(self, pose: Array, number: int) -> Array:
        """Return the room beyond the margin that a cycle keeps for where it may end otherwise."""
        most_m = RESOLUTION.most_deviation * self.robot.length_m
        return self.bending.tube_m(pose, self.motion.row(number), most_m)

    @property
    def joints(self) -> Joints:
        """How the valves play a cycle after another."""
        return self.motion.joints

    @cached_property
    def _cycles(self) -> dict[tuple[int, int], CycleRun]:
        return {}

    @cached_property
    def _step_s(self) -> float:
        """Return the step of searches, shorter the longer the way is."""
        way_s = float(self.to_goal.at(np.array([self.start.x, self.start.y])))
        s = RESOLUTION
        step_s = s.step_s * max(math.sqrt(s.long_s / max(way_s, s.long_s)), s.shortest)
        return step_s / 2 if self.fine else step_s

    def _cycle(self, before: int, gait: int) -> CycleRun:
        """Return the cycle of a gait after another, made when it is first asked for."""
        key = (gait, gait) if self.joints.is_plain(before, gait) else (before, gait)
        if key not in self._cycles:
            self._cycles[key] = CycleRun(self.integrator, self.joints.timeline(*key), self._step_s)
        return self._cycles[key]

    def as_planned(self, state: Array, run: Integrator | None = None) -> Array:
        """Return another robot's state as the planned robot's model has it: place, speed and curvature.

        `run` is that robot's model; by default one of the planned robot's kind.
        """
        return self.integrator.adopt(state, run or self.integrator)

    def bent(self, trajectory: Trajectory, before: int, gait: int) -> Trajectory:
        """Return the model's trajectory of one cycle as measured factors have it."""
        if self.bending.none:
            return trajectory
        share = trajectory.time_s / trajectory.time_s[-1]
        pose = self.bending.placed(trajectory.pose, before, gait, share)
        return replace(trajectory, pose=pose, final=np.concatenate([pose[-1], trajectory.final[POSE.stop :]]))

    def simulate(self, state: Array, before: int, gait: int) -> Cycle:
        """Return one cycle of a gait from a state of the model, after a cycle of another (or rest)."""
        (cycle,) = self.simulate_all([(state, before, gait)])
        if cycle is None:
            raise NoAnswerError(f"the simulation cannot continue with gait '{self.gaits.gaits[gait].name}'")
        return cycle

    def simulate_all(self, begins: Sequence[tuple[Array, int, int]]) -> list[Cycle | None]:
        """Return one cycle each from several states, gaits before and gaits, simulated side by side.

        Each result is independent of the others; None stands for a cycle that cannot be simulated.
        """
        found = run_batched([self._cycle(before, gait)(state) for state, before, gait in begins])
        went = [
            (before, gait, outcome)
            for (_, before, gait), outcome in zip(begins, found)
            if not isinstance(outcome, NoAnswerError)
        ]
        cycles = iter(self._kept(went))
        return [None if isinstance(outcome, NoAnswerError) else next(cycles) for outcome in found]

    def _kept(self, went: list[tuple[int, int, tuple[Array, Array]]]) -> list[Cycle]:
        """Return the cycles of gaits before, gaits, last states and samples (SAMPLES + 1, nx)."""
        if not went:
            return []
        samples = np.stack([sampled for *_, (_, sampled) in went])
        curved = samples[..., self.integrator.layout.kappa]
        lines = centre_lines(self.integrator, curved.reshape(-1, curved.shape[-1]))
        share = np.linspace(0.0, 1.0, samples.shape[1])
        pose = np.stack([self.bending.placed(p, b, g, share) for (b, g, _), p in zip(went, samples[..., :3])])
        placed = points_in_room(lines.reshape(*curved.shape[:-1], *lines.shape[1:]), pose)
        cycles = []
        for (_, gait, (last, _)), poses, body in zip(went, pose, placed):
            state = last if self.bending.none else np.concatenate([poses[-1], last[3:]])
            cycles.append(Cycle(state, poses, body, float(self.tube_m(poses, gait)[-1])))
        return cycles

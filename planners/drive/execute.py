"""Drive a plan closed-loop on the full dynamic model, a cycle at a time, until arrival, contact or a stop."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planners.drive.contact import BodyWatch
from planners.drive.friction_ensemble import FrictionEnsemble
from planners.drive.halt import halt
from planners.drive.plant import Plant, PlantStopped, SimulatedPlant
from planners.drive.reference import reference_of
from planners.drive.settings import DEFAULT_DRIVE, DriveSettings
from planners.plan.answer import Plan
from planners.plan.solve import solve_with_lattice
from planners.search.problem import ROUNDING_M, Problem
from planners.search.track import Choice, Learned, Where, by_plan, choose, nearest_node
from planners.search.tree import Root, arrival_index
from srs_opt.errors import InputError, NoAnswerError
from srs_opt.geometry import relative, wrapped
from srs_opt.model.parameters import valve_delay_s
from srs_opt.model.state import FORWARD, POSE, POSE_AND_SPEED
from srs_opt.robot import Robot
from srs_opt.simulate.timeline import Timeline

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Execution:
    """What happened when the plan was driven.

    Attributes
    ----------
    reached : bool
    collisions : int
        Contacts of the body with walls; the drive ends with the first.
    smallest_clearance_m, final_error_m, duration_s : float
        Nearest the body came to a wall; distance of the centre of mass from the goal at the end; time.
    replans : int
    gaits : tuple of int
        Played, a cycle each.
    starts_s : tuple of float
        When those cycles began.
    halts : tuple of (start_s, Timeline)
        What the valves did to come to rest; before the cycle after a halt is rest.
    reason : str
        Why it ended, in words.
    time_s, pose, lines : arrays (n,), (n, 3), (n, points, 2)
        The motion, body included.
    """

    reached: bool
    collisions: int
    smallest_clearance_m: float
    final_error_m: float
    duration_s: float
    replans: int
    gaits: tuple[int, ...]
    starts_s: tuple[float, ...]
    halts: tuple[tuple[float, Timeline], ...]
    reason: str
    time_s: Array
    pose: Array
    lines: Array

    def to_record(self) -> dict[str, Any]:
        """Return the `execution` entry of the command's JSON."""
        return {
            "reached": self.reached,
            "collisions": self.collisions,
            "smallest_clearance_m": round(self.smallest_clearance_m, 6),
            "final_error_m": round(self.final_error_m, 6),
            "duration_s": round(self.duration_s, 4),
            "replans": self.replans,
            "cycles": len(self.gaits),
            "reason": self.reason,
        }


def execute(
    problem: Problem,
    plan: Plan,
    true_robot: Robot | None = None,
    tell: Callable[[str], None] = lambda message: None,
    settings: DriveSettings = DEFAULT_DRIVE,
) -> Execution:
    """Drive `plan` on the dynamic model of `true_robot` (default: the planned robot).

    Raises
    ------
    InputError
        If the true robot cannot play the gaits.
    """
    robot = true_robot or problem.robot
    if robot.segments != problem.robot.segments:
        raise InputError(
            f"--true-robot '{robot.name}' has {robot.links} links, the plan is for {problem.robot.links}"
        )
    return Drive(problem, plan, SimulatedPlant(problem, robot), tell, settings).go()


class Drive:
    """One drive: the robot's state, the plan being followed, what was learned."""

    def __init__(
        self,
        problem: Problem,
        plan: Plan,
        plant: Plant,
        tell: Callable[[str], None],
        settings: DriveSettings = DEFAULT_DRIVE,
    ) -> None:
        self.problem, self.plant, self.tell, self.settings = problem, plant, tell, settings
        self.watch = BodyWatch(problem, plant.robot, plant.run)
        self.ensemble = FrictionEnsemble(problem)
        self.delay_s = valve_delay_s(plant.robot)
        self.state = plant.state
        self.before = problem.motion.rest
        self.learned = Learned()
        self.replans = self.halts = 0
        self.played: list[int] = []
        self.starts_s: list[float] = []
        self.halted: list[tuple[float, Timeline]] = []
        self._follow(plan)
        self.most_cycles = 20 + math.ceil(self.settings.patience * len(plan.gaits))

    def _follow(self, plan: Plan) -> None:
        self.plan, self.reference = plan, reference_of(self.problem, plan, self.settings)
        self.ends = np.array(
            [self.state[POSE_AND_SPEED], *(state[POSE_AND_SPEED] for state in plan.certificate.states)]
        )
        self.gaits_before = np.array([self.before, *plan.gaits])
        self.node = self.idle = 0

    def go(self) -> Execution:
        """Drive until something ends it."""
        self.watch.look(np.zeros(1), self.state[None, :3], np.zeros((1, self.problem.robot.segments)))
        while len(self.played) < self.most_cycles:
            try:
                ended = self._advance()
            except PlantStopped as stopped:
                ended = None if self._go_on_after(stopped) else self._done(stopped.reason)
            if ended is not None:
                return ended
        return self._stop(f"the goal was not reached within {self.most_cycles} cycles")

    def _advance(self) -> Execution | None:
        """Play one cycle, or halt and look for another way; return the end of the drive if this was it."""
        at_rest = self.before == self.problem.motion.rest
        if at_rest and self.played and self._at_goal():
            return self._done("arrived")  # it rolled out into the goal
        if self.plant.lost:
            return self._stop(self.plant.lost)
        gait = self._next_gait()
        if gait is None:
            reason = "no gait keeps the body off the walls and no other way was found"
            if self.halts == self.settings.most_halts or not self._halt():
                return self._stop(reason)
            if self._at_goal():
                return None
            self.tell(f"cycle {len(self.played)}: halted, replanning from rest")
            return None if self._plan_anew() else self._stop(reason)
        outcome = self._cycle(gait)
        if outcome == "arrived" and not self.plant.waits:
            self._halt()
        return None if outcome is None else self._done(outcome)

    def _go_on_after(self, stopped: PlantStopped) -> bool:
        """Look for another way from where the robot was stopped, if there may be one."""
        self.state, self.before = self.plant.state, self.problem.motion.rest
        self.halts += 1
        self.tell(f"cycle {len(self.played)}: {stopped.reason}")
        if not stopped.may_go_on or self.halts > self.settings.most_halts:
            return False
        return self._at_goal() or self._plan_anew()

    def _at_goal(self) -> bool:
        return arrival_index(self.problem.goal, self.state[None, :3]) is not None

    def _next_gait(self) -> int | None:
        choice = self._choice()
        settings, length = self.settings, self.problem.robot.length_m
        lost = choice.astray_m > settings.astray * length or self.idle >= settings.most_idle
        blocked = choice.clearance_m < settings.stop_clearance * length
        if (lost or blocked) and self.replans < settings.most_replans:
            self.replans += 1
            why = "strayed or stuck" if lost else "nothing fits"
            self.tell(f"cycle {len(self.played)}: {why}, replanning")
            if not self.plant.waits and self.before != self.problem.motion.rest:
                return None  # it cannot be planned in motion: halt first
            if self._plan_anew():
                choice = self._choice()
        if choice.clearance_m < self.settings.stop_clearance * self.problem.robot.length_m:
            return None
        self.predicted = choice.displacement
        return choice.gait

    def _choice(self) -> Choice:
        """Return the plan's gait where the robot is as planned, else the best that keeps off the walls.

        It should leave half the margin with any friction that the robot may have; else the gait is taken that
        leaves the most. Where every gait that was tried touches, the first is returned with a clearance that
        forbids it.
        """
        where = Where(self.state[POSE].copy(), self.before, float(self.state[FORWARD]))
        planned = self._gait_by_plan(self.state)
        enough_m = self.ensemble.enough_m
        if planned is not None and self._room_m(self.state, planned) > enough_m:
            if planned > self.problem.motion.rest:
                return self._own_cycle(planned)
            return by_plan(self.problem, where, self.learned, planned)
        tried: list[Choice] = []
        second, most_m = None, self.settings.least_room * self.problem.robot.length_m
        while len(tried) < self.settings.most_tried:
            barred = [choice.gait for choice in tried]
            choice = choose(
                self.problem, self.reference, where, self.learned, self.node, barred, self.settings.track
            )
            tried.append(choice)
            if choice.clearance_m < self.settings.stop_clearance * self.problem.robot.length_m:
                break
            room_m = self._room_m(self.state, choice.gait)
            if room_m > enough_m:
                return choice
            if room_m > most_m:
                second, most_m = choice, room_m
        return second or replace(tried[0], clearance_m=-math.inf)

    def _own_cycle(self, number: int) -> Choice:
        """Return a cycle that was made for the plan, which says what it should do."""
        k = self.plan.gaits.index(number)
        moved = np.stack([np.zeros(3), relative(self.ends[k, :3], self.ends[k + 1, :3])])[None]
        common = replace(self.learned, own={})
        predicted = common.apply(moved, self.problem.joints.gait(number).period_s)
        return Choice(number, predicted[0, -1], math.inf, 0.0)

    def _room_m(self, state: Array, gait: int) -> float:
        """Return the least clearance over a cycle with any friction that the robot may have."""
        timeline = self.problem.joints.timeline(self.before, gait)
        return self.ensemble.least_room_m(state, timeline, 0.0, (self.before, gait))

    def _gait_by_plan(self, state: Array) -> int | None:
        """Return the gait that the plan plays next, if the robot is as the plan has it after a cycle."""
        off = np.abs(state[POSE_AND_SPEED] - self.ends[:-1])
        off[:, 2] = np.abs(wrapped(off[:, 2]))
        length = self.problem.robot.length_m
        off = (off / (np.array(self.settings.on_track) * (length, length, 1.0, length))).max(axis=1)
        off[self.gaits_before[:-1] != self.before] = math.inf
        cycle = int(off.argmin())
        return self.plan.gaits[cycle] if off[cycle] < 1 else None

    def _plan_anew(self) -> bool:
        """Look for a way from here; the model takes over place, speed and curvature."""
        # half the margin is asked for on the way, and where the robot is now, no more than it has
        at_rest = self.before == self.problem.motion.rest
        relaxed = replace(self.problem, margin_m=self.problem.margin_m / 2)
        slack = min(0.0, self.watch.now_m - relaxed.margin_m) - ROUNDING_M
        try:
            result = solve_with_lattice(
                relaxed,
                root=Root(self.state, self.before, slack),
                time_limit_s=self.settings.rest_s if at_rest else self.settings.replan_s,
                max_nodes=self.settings.rest_cycles if at_rest else self.settings.replan_cycles,
            )
        except NoAnswerError:
            return False
        if result.plan is None:
            return False
        self._follow(result.plan)
        return True

    def _cycle(self, index: int) -> str | None:
        """Play one cycle; return what ended the drive, if anything."""
        period_s = self.problem.joints.gait(index).period_s
        begin, before = self.state[POSE].copy(), self.state
        cycle = self.problem.joints.timeline(self.before, index)
        plain = self.problem.joints.is_plain(self.before, index)
        start_s = self.watch.time_s
        trajectory = self.plant.play(cycle, index if plain else None)
        arrived = self.watch.look(trajectory.time_s, trajectory.pose, trajectory.kappa)
        self.state = self.plant.state
        self.played.append(index)
        self.starts_s.append(start_s)
        gait_before, self.before = self.before, index
        if self.watch.touched:
            return "contact"
        if arrived:
            return "arrived"
        self.ensemble.learn(before, cycle, self.state, (gait_before, index))
        observed = relative(begin, self.state[POSE])
        self.learned = self.learned.update(
            self.predicted,
            observed,
            period_s,
            self.problem.motion.row(index),
            self.problem.robot.length_m,
            self.settings.track,
        )
        node = nearest_node(self.reference, self.state[POSE], self.node, self.settings.track)
        self.idle = 0 if node > self.node else self.idle + 1
        self.node = node
        return None

    def _stop(self, reason: str) -> Execution:
        if self.before != self.problem.motion.rest:
            self._halt()
        return self._done(reason)

    def _halt(self) -> bool:
        """Bring the robot to rest where there is room for it; return whether it came to no harm."""
        self.halts += 1
        try:
            valves = halt(self.ensemble, self.state, self.before)
            self.halted.append((self.watch.time_s, valves))
            trajectory = self.plant.play(valves, None)
        except PlantStopped as stopped:  # it vented by itself
            if not stopped.may_go_on:
                raise
        else:
            self.watch.look(trajectory.time_s, trajectory.pose, trajectory.kappa, ends=False)
        self.state = self.plant.state
        self.before = self.problem.motion.rest
        return not self.watch.touched

    def _done(self, outcome: str) -> Execution:
        w = self.watch
        time, pose, lines = w.record()
        reached = outcome == "arrived"
        reason = {
            "arrived": "arrived",
            "contact": f"the body touched a wall at {w.where_touched}, {time[-1]:.1f} s after the start",
        }.get(outcome, f"stopped: {outcome}" + (" (it touched a wall rolling out)" if w.touched else ""))
        error = 0.0 if reached else float(self.problem.goal.distance(pose[-1, :2]))
        return Execution(
            reached and not w.touched,
            int(w.touched),
            w.smallest_m,
            error,
            float(time[-1]) + self.delay_s,
            self.replans,
            tuple(self.played),
            tuple(self.starts_s),
            tuple(self.halted),
            reason,
            time,
            pose,
            lines,
        )

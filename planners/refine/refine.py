"""A plan's cycles optimized window after window, certified afresh; never slower than the plan itself.

A window holds a few cycles, begun from the exact state in which the ones before it leave the robot. It ends,
in less time, where the plan had its last cycle end, within a tolerance: what comes later stays possible.
Then its first cycles are put on ticks and kept, and the window moves on. The last window ends in the goal.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from planners.motion.valves import Joint, gait_end
from planners.plan.answer import Plan
from planners.plan.certify import certify
from planners.plan.settings import PLAN_CERTIFICATE
from planners.refine.limits import End, Limits, Values
from planners.refine.settings import WINDOW
from planners.refine.shots import with_sensitivity
from planners.refine.solve import Before, Found, WindowSolver
from planners.refine.ticks import on_ticks
from planners.refine.window import Window
from planners.search.problem import Problem
from planners.search.tree import at_rest
from srs_opt.errors import InputError, NoAnswerError
from srs_opt.manoeuvre.order import standing_s
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.robot import Robot

Array = NDArray[np.float64]
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Refinement:
    """What became of a plan.

    Attributes
    ----------
    problem : Problem
        That knows the cycles made for the plan, if there are any.
    plan : Plan
        The faster one, or the plan itself.
    reason : str
        Why the plan was kept; empty when it is faster.
    before_s, seconds : float
        Duration of the plan before; processor time spent.
    """

    problem: Problem
    plan: Plan
    reason: str
    before_s: float
    seconds: float

    def to_record(self) -> dict[str, object]:
        """Return the `refined` entry of the command's JSON."""
        return {
            "from_s": round(self.before_s, 5),
            "to_s": round(self.plan.duration_s, 5),
            "seconds": round(self.seconds, 3),
            "kept": self.reason or None,
        }

    def in_words(self) -> str:
        """Return a line for people."""
        if self.reason:
            return f"not refined: {self.reason}; the plan is kept as found"
        less = 100 * (1 - self.plan.duration_s / self.before_s)
        return (
            f"refined from {self.before_s:.2f} to {self.plan.duration_s:.2f} s ({less:.1f} % less) in "
            f"{self.seconds:.1f} s"
        )


def check_refinable(robot: Robot, model: str, *, cost: str = "time", calibrated: bool = False) -> None:
    """Refuse what the optimization knows nothing of.

    Parameters
    ----------
    robot : Robot
    model : str
    cost : str
        What plans shall have little of.
    calibrated : bool
        Whether cycles are bent by measured factors.

    Raises
    ------
    InputError
        If cycles are bent, something else than time shall be small, or the actuators are not linear in
        pressure or depend on a gait's frequency.
    """
    if calibrated:
        raise InputError("--refine optimizes the model's own motion: expected no --drive beside it")
    if cost != "time":
        raise InputError(f"--refine shortens the time: expected --cost time beside it, found {cost}")
    (*_, actuator), name = build(Structure.of(robot, model)), robot.name
    if actuator.by_frequency:
        raise InputError(
            f"--refine: effect '{actuator.by_frequency[0]}' of robot '{name}' goes by a gait's frequency, "
            "which cycles of their own duration do not have; expected a robot without it"
        )
    if not actuator.linear:
        raise InputError(
            f"--refine: the actuators of robot '{name}' have an effect that is not linear; expected a robot "
            "without it"
        )


def refine(problem: Problem, plan: Plan, tell: Tell = lambda message: None) -> Refinement:
    """Return the plan with all its switches, cycle ends and pressures optimized for time."""
    began = time.process_time()
    reason = "nothing faster was found"
    refiner = _Refiner(problem, plan, tell)
    for spare in WINDOW.spares:
        try:
            own = refiner.cycles(spare)
        except NoAnswerError as error:
            reason = str(error)
            continue
        origin = problem.motion.rows(plan.gaits[: len(own)])
        known = replace(problem, motion=problem.motion.with_own(own, origin))
        numbers = tuple(problem.motion.rest + 1 + k for k in range(len(own)))
        certificate = certify(known, numbers)
        if certificate.passed:
            better = Plan(plan.planner, numbers, certificate)
            if better.duration_s < plan.duration_s - WINDOW.least_gain_s:
                return Refinement(known, better, "", plan.duration_s, time.process_time() - began)
            reason = "nothing faster was found"
            break
        reason = f"certificate failed: {certificate.reason}"
        tell(f"refined plan: {reason}")
        assert certificate.failed_cycle is not None  # it has failed
        refiner.back_to(certificate.failed_cycle)
    return Refinement(problem, plan, reason, plan.duration_s, time.process_time() - began)


@dataclass(frozen=True)
class _Place:
    """Where a window begins: cycles kept before, what is left of the plan, state, valves before."""

    kept: tuple[Joint, ...]
    guess: tuple[Joint, ...]
    state: Array
    before: Before


class _Refiner:
    """Moves the window along one plan; can go back and on again with more room to spare."""

    def __init__(self, problem: Problem, plan: Plan, tell: Tell) -> None:
        self.problem, self.plan, self.tell = problem, plan, tell
        joints, c = problem.joints, plan.certificate
        numbers = plan.gaits[: int(c.cycle[-1]) + 1]
        found = [joints.joint(a, b) for a, b in zip((problem.motion.rest, *numbers), numbers)]
        self.planned = [joint for joint in found if joint is not None]
        self.ends = c.states
        begin_s = sum(joint.gait.period_s for joint in self.planned[:-1])
        self.arrives_s = float(c.time_s[-1]) - begin_s  # after the last cycle's begin
        kpa = [entry.gait.pressure_kpa for entry in problem.gaits.gaits]
        self.pressures = min(kpa), max(kpa)

        self.steps_left = round(WINDOW.steps_per_s * plan.duration_s)
        segments = problem.robot.segments
        at_start = Before((0,) * segments, (np.inf,) * segments)
        self.places = [_Place((), tuple(self.planned), at_rest(problem).state, at_start)]

    def back_to(self, cycle: int) -> None:
        """Go back to the last window that began before a cycle."""
        while len(self.places) > 1 and len(self.places[-1].kept) >= cycle:
            self.places.pop()

    def cycles(self, spare: float) -> list[Joint]:
        """Return the refined cycles; from the last place on, with so much room to spare.

        Raises
        ------
        NoAnswerError
            If a window has no answer, or too few steps are left.
        """
        problem, count = self.problem, len(self.planned)
        while True:
            here = self.places[-1]
            first, guess = len(here.kept), list(here.guess)
            size = min(WINDOW.cycles, count - first)
            last = first + size == count
            window = Window.of_cycles(guess[:size], problem.joints.limits)
            if not first:
                window = replace(window, ramp_s=(0.0, *window.ramp_s[1:]))
            full = window
            if last:
                window = _until(window, self.arrives_s)
            end = End() if last else End(self.ends[first + size - 1])
            limits = Limits(problem, end, 0.0 if first else problem.start_slack_m, spare)
            solver = WindowSolver(
                problem.integrator, here.state, limits, here.before, problem.joints.limits, self.pressures
            )
            if not last:
                solver.tail_s = standing_s(guess[size].gait, problem.joints.limits.dwell_s)
            found = solver.solve(window, self._steps(count - first))
            self.steps_left -= solver.steps
            now = size if last else WINDOW.kept
            window = self._rounded(solver, found, now)
            if last:
                window = _with_rest(
                    window, full, self.arrives_s, problem.joints.limits.dwell_s, problem.joints.limits.tick_s
                )
            done = [window.cycle(k) for k in range(now)]
            kept = (*here.kept, *done)
            if last:
                return list(kept)
            state = here.state
            for joint in done:
                state = self._played(joint, state)
            states, ages_s = gait_end(done[-1].gait)
            guess = [*(window.cycle(k) for k in range(now, size)), *guess[size:]]
            guess[size - now] = replace(guess[size - now], from_kpa=window.pressure_kpa[-1])
            self.places.append(_Place(kept, tuple(guess), state, Before(tuple(states), tuple(ages_s))))
            self.tell(f"refining: {len(kept)} of {count} cycles")

    def _steps(self, cycles: int) -> int:
        """Return how many steps the next window may take, with so many cycles to go."""
        windows = 1 + max(0, math.ceil((cycles - WINDOW.cycles) / WINDOW.kept))
        steps = min(WINDOW.steps, self.steps_left // windows)
        if steps < WINDOW.least_steps:
            raise NoAnswerError("the steps that were allowed have been taken")
        return steps

    def _rounded(self, solver: WindowSolver, found: Found, cycles: int) -> Window:
        shot = with_sensitivity(solver.run, solver.start, found.shot)
        (rows,) = solver.limits([shot])
        room = Values(rows.values[solver.limits.ends :], rows.jacobian[solver.limits.ends :])
        window = on_ticks(shot.window, room, cycles, self.problem.joints.limits.tick_s)
        # what is not kept yet is put right by the next window; its dwell begins with what is kept
        _, spare = solver.order_rows(window.first(cycles), 0)
        if spare.min() < -1e-9:
            raise NoAnswerError("the refined cycles cannot be quantized to the valves' ticks")
        return window

    def _played(self, joint: Joint, state: Array) -> Array:
        s = PLAN_CERTIFICATE
        tolerance = s.tolerance * self.problem.robot.length_m / s.finer
        return self.problem.integrator.integrate(joint.timeline(s.stair_s), state, tolerance).final


def _until(window: Window, arrives_s: float) -> Window:
    """Return the window up to so long after its last cycle's begin."""
    begin = window.ends_s[-2] if window.cycles > 1 else 0.0
    end = begin + arrives_s
    rows, owners = [], []
    for row, mine in zip(window.rows, window.cycle_of):
        count = sum(t < end - 1e-6 for t in row.times_s)
        rows.append(replace(row, states=row.states[: count + 1], times_s=row.times_s[:count]))
        owners.append(mine[:count])
    return replace(window, rows=tuple(rows), cycle_of=tuple(owners), ends_s=(*window.ends_s[:-1], end))


def _with_rest(window: Window, full: Window, arrives_s: float, dwell_s: float, tick_s: float) -> Window:
    """Return the last window with what its last cycle plays after the arrival, as late as planned."""
    later = window.ends_s[-1] - (full.ends_s[-2] if full.cycles > 1 else 0.0) - arrives_s
    rows, owners = [], []
    end = full.ends_s[-1] + later
    for row, mine, whole in zip(window.rows, window.cycle_of, full.rows):
        times = list(row.times_s)
        for t in whole.times_s[len(times) :]:
            least = times[-1] + dwell_s if times else 0.0
            times.append(np.ceil(max(t + later, least) / tick_s - 1e-6) * tick_s)
        rows.append(replace(row, states=whole.states, times_s=tuple(times)))
        owners.append((*mine, *[window.cycles - 1] * (len(times) - len(mine))))
        end = max(end, times[-1] + 2 * tick_s)
    end = float(np.ceil(end / tick_s - 1e-6) * tick_s)
    return replace(window, rows=tuple(rows), cycle_of=tuple(owners), ends_s=(*window.ends_s[:-1], end))

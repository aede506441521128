"""Planning and driving in one call each: the route through a maze, and how it was driven."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from planners.drive.execute import Execution, execute
from planners.maze.maze import Maze
from planners.maze.places import Goal, Pose
from planners.motion.valves import DEFAULT_LIMITS, ValveLimits
from planners.plan.answer import Plan, PlanResult
from planners.plan.explain import Explanation, explain
from planners.plan.inputs import check_margin, gaits_for, placed_maze, planning_problem
from planners.plan.looks import Looks, looks
from planners.plan.options import MARGIN_M
from planners.plan.portfolio import PlanRequest, solve
from planners.refine.refine import Refinement, check_refinable, refine
from planners.search.cost_model import Cost
from planners.search.problem import Problem
from srs_opt.drive.calibration import DriveCalibration
from srs_opt.errors import NoAnswerError
from srs_opt.gait_opt.table import GaitTable
from srs_opt.result import Result
from srs_opt.robot import Robot, wpi_srs

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Route(Result):
    """A planner's answer with the problem that it answers.

    Attributes
    ----------
    problem : Problem
    result : PlanResult
    refinement : Refinement, optional
        What `refined` made of the plan.
    """

    problem: Problem
    result: PlanResult
    refinement: Refinement | None = None

    @property
    def solved(self) -> bool:
        """Whether there is a certified plan."""
        return self.result.plan is not None

    @property
    def plan(self) -> Plan:
        """The certified plan; NoAnswerError, with the reason, where there is none."""
        if self.result.plan is None:
            raise NoAnswerError(f"{self.result.status}: {self.explanation.in_words(self.result.reason)}")
        return self.result.plan

    @cached_property
    def looks(self) -> Looks:
        """What holds of the plan between looks of a camera, and without any."""
        return looks(self.problem, self.plan)

    @cached_property
    def explanation(self) -> Explanation:
        """Where there is no plan: the tightest place on the widest route."""
        return explain(self.problem)

    def refined(self, say: Callable[[str], None] = lambda message: None) -> Route:
        """Return the route with all switch times of its plan optimized at once, certified afresh.

        The plan stays where nothing faster is found; `refinement` says why.

        Raises
        ------
        InputError
            If the optimization knows nothing of what the plan is for (`check_refinable`).
        """
        problem = self.problem
        calibrated = not problem.bending.none
        check_refinable(problem.robot, problem.gaits.model, cost=problem.cost, calibrated=calibrated)
        found = refine(self.problem, self.plan, say)
        return Route(found.problem, replace(self.result, plan=found.plan), found)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object of the command `plan`, without execution."""
        record = self.result.to_record(self.problem)
        if self.refinement is not None:
            record["refined"] = self.refinement.to_record()
        if self.solved:
            return {**record, "looks": self.looks.to_record()}
        reason = self.explanation.in_words(self.result.reason)
        return {**record, "reason": reason, "tightest": self.explanation.to_record()}

    def in_words(self) -> str:
        """Return length, time and clearance, or why there is no plan."""
        result, took = self.result, f"{self.result.planning_s:.2f} s"
        if result.plan is None:
            return f"{result.status}: {self.explanation.in_words(result.reason)} ({took})"
        plan = result.plan
        if self.refinement is not None:
            took += f" ({self.refinement.in_words()})"
        return (
            f"solved by {plan.planner} in {took}: {plan.length_m:.2f} m, {plan.duration_s:.1f} s, "
            f"{len(plan.gaits)} cycles, clearance at least {1e3 * plan.certificate.clearance_m:.1f} mm, "
            "certified"
        )

    def figure(self) -> Figure:
        """Return the maze with the swept body, or with the place where there is no way."""
        from planners.view.obstruction import obstruction_figure
        from planners.view.picture import plan_figure

        if not self.solved:
            return obstruction_figure(self.problem, self.explanation)
        return plan_figure(self.problem, self.plan)


@dataclass(frozen=True, repr=False)
class DrivenRoute(Result):
    """A route as it was driven closed-loop on a dynamic model.

    Attributes
    ----------
    route : Route
    execution : Execution
    """

    route: Route
    execution: Execution

    def to_dict(self) -> dict[str, Any]:
        """Return the entry `execution` of the command's JSON object."""
        return self.execution.to_record()

    def in_words(self) -> str:
        """Return why the drive ended, its time, clearance and new plans."""
        e = self.execution
        return (
            f"driven: {e.reason}; {e.duration_s:.1f} s, smallest clearance "
            f"{1e3 * e.smallest_clearance_m:.1f} mm, {e.replans} new plans on the way"
        )

    def figure(self) -> Figure:
        """Return the picture of the plan with the way that was driven."""
        from planners.view.picture import plan_figure

        return plan_figure(self.route.problem, self.route.plan, self.execution)


def plan(
    maze: Maze | Path | str,
    robot: Robot | None = None,
    gaits: GaitTable | None = None,
    *,
    start: Pose | None = None,
    goal: Goal | None = None,
    margin_m: float = MARGIN_M,
    valves: ValveLimits = DEFAULT_LIMITS,
    drive: DriveCalibration | None = None,
    cost: Cost = "time",
    planner: str = "auto",
    seed: int = 0,
    time_limit_s: float = 60.0,
    best: bool = False,
    say: Callable[[str], None] = lambda message: None,
) -> Route:
    """Return a certified way through a maze for the whole body of the robot, or why there is none.

    Parameters
    ----------
    maze : Maze or path
    robot : Robot, optional
        Default: the built-in WPI SRS.
    gaits : GaitTable, optional
        Default: the one built for this robot; for a new robot that takes minutes, once.
    start, goal : optional
        In place of the maze's.
    margin_m, valves, drive, cost
        As in `planning_problem`.
    planner, seed, time_limit_s, best
        As in `PlanRequest`.
    say : callable, optional
        Gets lines of progress.

    Raises
    ------
    InputError
        If something that is wanted makes no sense.

    Examples
    --------
    >>> import srs_opt as srs
    >>> route = srs.plan("mazes/first.yaml")
    >>> route.solved
    True
    """
    robot = robot or wpi_srs()
    check_margin(robot, margin_m)
    placed = placed_maze(robot, maze, margin_m, start=start, goal=goal)
    table = gaits or gaits_for(robot, tell=say)
    problem = planning_problem(
        robot, placed, table, margin_m=margin_m, valves=valves, drive=drive, cost=cost, tell=say
    )
    return Route(problem, solve(problem, PlanRequest(planner, seed, time_limit_s, best), say))


def drive_plan(
    route: Route, true_robot: Robot | None = None, say: Callable[[str], None] = lambda message: None
) -> DrivenRoute:
    """Drive a route closed-loop on the dynamic model of `true_robot` (default: the planned robot).

    Raises
    ------
    NoAnswerError
        If the route has no plan.
    InputError
        If the true robot cannot play the gaits.

    Examples
    --------
    >>> import srs_opt as srs
    >>> srs.drive_plan(srs.plan("mazes/first.yaml")).execution.reached
    True
    """
    return DrivenRoute(route, execute(route.problem, route.plan, true_robot, say))

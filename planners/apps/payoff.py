"""What a corrected robot file buys in a maze: plans before and after, both driven by the corrected robot."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from planners.drive.execute import Execution, execute
from planners.maze.maze import Maze
from planners.motion.store import load_motion
from planners.plan.answer import Plan
from planners.plan.certify import Certificate, certify
from planners.plan.inputs import placed_maze
from planners.plan.options import MARGIN_M
from planners.plan.solve import solve_with_lattice
from planners.search.problem import Problem
from srs_opt.gait import Gait
from srs_opt.gait_opt.companions import duty_biased_family
from srs_opt.gait_opt.table import GaitTable
from srs_opt.robot import Robot

MOST_NODES, TIME_LIMIT_S = 20_000, 120.0
Tell = Callable[[str], None]


@dataclass(frozen=True)
class PlanRun:
    """One plan, and what the corrected robot makes of it.

    Attributes
    ----------
    problem : Problem
        Of the robot that planned.
    plan : Plan
    open_loop : Certificate
        The plan's valves played on the corrected robot without looking.
    driven : Execution
        The plan driven by the corrected robot with feedback every cycle.
    """

    problem: Problem
    plan: Plan
    open_loop: Certificate
    driven: Execution

    @property
    def away_m(self) -> float:
        """Distance, at the end of the open-loop run, from where the plan is then."""
        end = min(self.plan.duration_s, float(self.open_loop.time_s[-1]))
        planned, open_loop = (
            np.array([np.interp(end, c.time_s, c.pose[:, k]) for k in range(2)])
            for c in (self.plan.certificate, self.open_loop)
        )
        return float(np.linalg.norm(planned - open_loop))

    def to_record(self) -> dict[str, Any]:
        """Return one side of the `maze` entry of the command's JSON."""
        return {
            "planned_s": round(self.plan.duration_s, 3),
            "open_loop_end_away_m": round(self.away_m, 5),
            "open_loop_clearance_m": round(self.open_loop.clearance_m, 5),
            "driven": self.driven.to_record(),
        }

    def in_words(self) -> str:
        """Return what came of the plan."""
        touched = "touching a wall" if self.open_loop.clearance_m <= 0 else "without touching"
        end = f"in {self.driven.duration_s:.1f} s" if self.driven.reached else f"not: {self.driven.reason}"
        return (
            f"promises {self.plan.duration_s:.1f} s; open loop it ends "
            f"{1e3 * self.away_m:.0f} mm from there, {touched}; driven with feedback it arrives {end}"
        )


@dataclass(frozen=True)
class MazePayoff:
    """Plans of the calibrated (before) and of the corrected robot (after); None where there is no way.

    Attributes
    ----------
    maze : Maze
    before, after : PlanRun or None
    """

    maze: Maze
    before: PlanRun | None
    after: PlanRun | None

    def to_record(self) -> dict[str, Any]:
        """Return the `maze` entry of the command's JSON."""
        sides = {"before": self.before, "after": self.after}
        return {
            "name": self.maze.name,
            **{k: None if r is None else r.to_record() for k, r in sides.items()},
        }

    def in_words(self) -> str:
        """Return a sentence."""
        said = [
            f"the {which} robot's plan {'does not exist' if run is None else run.in_words()}"
            for which, run in (("calibrated", self.before), ("corrected", self.after))
        ]
        return f"through {self.maze.name}, on the corrected robot: {'; '.join(said)}"


def payoff_maze(robot: Robot, path: Path) -> Maze:
    """Return the maze of a file; InputError where the robot does not fit at its start."""
    return placed_maze(robot, path, MARGIN_M)


def maze_payoff(
    before: tuple[Robot, Gait],
    after: tuple[Robot, Gait],
    maze: Maze,
    model: str = "complex",
    tell: Tell = lambda message: None,
) -> MazePayoff:
    """Plan with both robots' fastest gaits and their companions; drive both plans on the corrected robot.

    Parameters
    ----------
    before, after : (Robot, Gait)
        The calibrated and the corrected robot, each with its fastest straight gait.
    maze : Maze
    model : {"complex", "simplified"}
    tell : callable
        Gets messages about the progress.
    """
    truth = after[0]
    runs = [_run_plan(robot, gait, truth, maze, model, tell) for robot, gait in (before, after)]
    return MazePayoff(maze, *runs)


def _run_plan(robot: Robot, gait: Gait, truth: Robot, maze: Maze, model: str, tell: Tell) -> PlanRun | None:
    tell(f"planning through {maze.name}{' with the effects' if robot is truth else ''}")
    problem = _problem(robot, duty_biased_family(robot, gait, model), maze)
    plan = solve_with_lattice(problem, max_nodes=MOST_NODES, time_limit_s=TIME_LIMIT_S).plan
    if plan is None:
        return None
    tell("driving the plan on the corrected robot")
    open_loop = certify(Problem(truth, problem.gaits, problem.motion, maze, MARGIN_M), plan.gaits)
    return PlanRun(problem, plan, open_loop, execute(problem, plan, truth))


def _problem(robot: Robot, table: GaitTable, maze: Maze) -> Problem:
    return Problem(robot, table, load_motion(robot, table), maze, MARGIN_M)

"""One call: optimize a gait for an objective, built in or of one's own."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.collocation.solver import Solver
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.objectives.objective import Formula, Objective
from srs_opt.gait_opt.objectives.registry import objective_named
from srs_opt.gait_opt.search import Found, Where, search
from srs_opt.robot import Robot


def optimize_gait(
    robot: Robot | Sequence[Robot],
    objective: Formula | Objective | str = "speed",
    constraints: Sequence[Formula] = (),
    *,
    limits: Limits | None = None,
    turn: str = "straight",
    starts: int = 4,
    seed: int = 0,
    solver: Solver | None = None,
    say: Callable[[str], None] = lambda text: None,
    **wanted: Any,
) -> Found:
    """Return the best gait found: one on-interval per segment and cycle, certified by simulation.

    Parameters
    ----------
    robot : Robot or several
        One gait for all of them; the worst counts.
    objective : callable, Objective or str
        A function of a `GaitCycle` that returns what is to be as large as possible, or a known name.
    constraints : callables
        Functions of a `GaitCycle`: an expression that must not be negative, or (low, expression, high).
    limits : Limits, optional
    turn : {"straight", "side", "any"}
        How a function of one's own lets the gait turn where no radius or turn rate is wanted.
    starts, seed
        As in `search`.
    solver : Solver, optional
    say : callable, optional
        Gets lines of progress.
    **wanted
        Further attributes of `Goal`: speed_m_s, radius_m, turn_rate_rad_s, envelope_m, least_speed_m_s, side.

    Raises
    ------
    InputError
        If something that is wanted makes no sense, or a function fails.
    NoAnswerError
        If no start leads anywhere.
    """
    robots = (robot,) if isinstance(robot, Robot) else tuple(robot)
    if isinstance(objective, str):
        objective = objective_named(objective)
    elif not isinstance(objective, Objective):
        name = re.sub(r"\W", "", getattr(objective, "__name__", "own")) or "own"
        objective = Objective(name, objective, turn=turn)
    goal = Goal(_constrained(objective, tuple(constraints)), **wanted)
    problem = CycleProblem(robots, robots[0].own_model, goal, limits or Limits(), solver=solver or Solver())
    return search(problem, starts, seed, say, where=Where())


def _constrained(objective: Objective, constraints: tuple[Formula, ...]) -> Objective:
    """Return the objective with more constraints, also where another takes its place."""
    if not constraints:
        return objective
    # the constraints hold for whatever takes the objective's place, too
    other = objective.unless_turn
    return replace(
        objective,
        constraints=(*objective.constraints, *constraints),
        quick=False,
        unless_turn=None if other is None else _constrained(other, constraints),
    )

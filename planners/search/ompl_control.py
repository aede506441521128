"""OMPL's control planners (RRT, EST, KPIECE1) on cycles of gaits, and other searches as OMPL's planners.

Every planner, OMPL's or not, is an `ompl.base.Planner` here and is given the same set-up (`cycle_setup`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from planners.search.ompl_problem import CycleSetup, cycle_setup, gaits_of, path_of
from planners.search.ompl_setup import counted, seeded, until_a_signal
from planners.search.problem import Problem

MakePlanner = Callable[[Any], Any]  # from a SpaceInformation


def run_planner(problem: Problem, make: MakePlanner, iterations: int, seed: int) -> tuple[int, ...] | None:
    """Return the gaits of a way that an OMPL planner finds, or None.

    Parameters
    ----------
    problem : Problem
    make : callable
        Takes the `ompl.control.SpaceInformation` and returns an `ompl.base.Planner`.
    iterations : int
        After how many the planner gives up.
    seed : int
    """

    def found(stop: Callable[[], bool]) -> tuple[int, ...] | None:
        seeded(seed)
        setup = cycle_setup(problem).setup
        planner = make(setup.getSpaceInformation())
        setup.setPlanner(planner)
        setup.setup()
        setup.solve(counted(iterations, stop))
        return gaits_of(problem, setup.getSolutionPath()) if setup.haveExactSolutionPath() else None

    return until_a_signal(found)


def as_ompl_planner(
    cycles: CycleSetup, name: str, find: Callable[[Callable[[], bool]], Sequence[int] | None]
) -> Any:
    """Return a plain search as an `ompl.base.Planner`.

    Parameters
    ----------
    cycles : CycleSetup
    name : str
    find : callable
        Takes a function that says when to stop, and returns the gaits of a way, or None.
    """
    from ompl import base

    class Plain(base.Planner):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(cycles.information, name)

        def solve(self, until: Any) -> Any:
            gaits = find(lambda: bool(until.eval()))
            if gaits is None:
                return base.PlannerStatus(False, False)
            self.getProblemDefinition().addSolutionPath(path_of(cycles, gaits), False, 0.0, name)
            return base.PlannerStatus(True, False)

    return Plain()

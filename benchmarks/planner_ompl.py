"""OMPL's own benchmark (``ompl.tools.Benchmark``) on narrow passages.

Its planners look for a curve of bounded radius along which a straight strip, as wide as the slimmest gait
sweeps, keeps off the walls. What such a curve is worth is seen afterwards, outside the clock: the dynamic
model follows it, and the certificate judges. Beside them, ours on the same passages, from nothing to a
certified plan.
"""

from __future__ import annotations

import random
from typing import Any

import numpy as np

from benchmarks.planner_narrow import MARGIN_M, attempt, setting
from benchmarks.section import Section
from planners.benchmark.runs import in_own_process, recorded
from planners.generate.areas import corridor
from planners.maze.places import RobotSize
from planners.plan.certify import certify
from planners.search.follow import follow, reference_along
from planners.search.ompl_geometric import curves_of, poses_along, strip_setup
from planners.search.ompl_setup import seeded
from planners.search.problem import Problem
from planners.search.settings import ROUTE

METHODS = ("RRTConnect", "BITstar", "RRT", "KPIECE1", "RRTstar")
Run = tuple[str, float, bool, bool, bool]  # planner, s, exact, its path checks, certified


def passage(ratio: float, seed: int) -> Problem:
    """Return the passage of the narrow study with this width and seed."""
    robot, gaits, motion, slimmest = setting()
    size = RobotSize(robot.length_m, robot.body_width_m / 2, MARGIN_M)
    maze = corridor(0.3, ratio * slimmest + 2 * MARGIN_M, 0.5, random.Random(seed), size)
    return Problem(robot, gaits, motion, maze, MARGIN_M)


def ompl_runs(ratio: float, count: int, limit_s: float) -> list[Run]:
    """Return OMPL's runs of all methods through one passage."""
    from ompl import geometric, tools

    seeded(1)
    problem = passage(ratio, 0)
    setup = strip_setup(problem, "dubins", curves_of(problem)[1])
    setup.setup()
    benchmark = tools.Benchmark(setup, f"passage {ratio:g}")
    for method in METHODS:
        benchmark.addPlanner(getattr(geometric, method)(setup.getSpaceInformation()))
    certified: list[bool] = []  # in the order of the runs; OMPL keeps no property that Python adds
    benchmark.setPostRunEvent(lambda planner, properties: certified.append(_certified(problem, planner)))
    request = tools.Request(
        limit_s,
        runCount=count,
        timeBetweenUpdates=0.0,  # no second thread: Python checks validity in this one
        displayProgress=False,
        saveConsoleOutput=False,
        simplify=False,
    )
    benchmark.benchmark(request)
    _, runs = recorded(benchmark)
    return [
        (name.removeprefix("k"), time, exact, right, passed)
        for (name, time, exact, right), passed in zip(runs, certified)
    ]


def _certified(problem: Problem, planner: Any) -> bool:
    """Return whether the model can follow the run's path, and the certificate passes."""
    definition = planner.getProblemDefinition()
    if not definition.hasExactSolution():
        return False
    path = poses_along(definition.getSolutionPath(), ROUTE.step * problem.robot.length_m)
    way = None if path is None else follow(problem, reference_along(problem, path))
    return way is not None and certify(problem, tuple(step.gait for step in way)).passed


def _told(runs: list[Run]) -> str:
    exact = [run for run in runs if run[2]]
    right, certified = sum(run[3] for run in exact), sum(run[4] for run in exact)
    times = f" ({np.median([run[1] for run in exact]):.2f} s)" if exact else ""
    return f"{len(exact)}, {right}, {certified}{times}"


def run(quick: bool) -> Section:
    """Return success and time against width."""
    ratios, count, limit_s = ((2.0,), 1, 0.5) if quick else ((1.15, 1.3, 1.6, 2.0), 5, 2.0)
    rows = []
    for ratio in ratios:
        runs = in_own_process(ompl_runs, ratio, count, limit_s, what=f"width {ratio:g}")
        ours = attempt(ratio, "ours", 0)
        mine = f"{'certified' if ours['solved'] else 'none'} ({ours['cpu_s']:.2f} s)"
        told = [_told([run for run in runs if run[0] == method]) for method in METHODS]
        rows.append([f"{ratio:.2f}", mine, *told])
    notes = [
        f"{count} runs of {limit_s:g} s each. Three counts: runs that OMPL calls exact, those of them whose "
        "path passes OMPL's own check, and those that become a certified plan of the snake. In brackets the "
        "median time of the exact ones, which holds neither following nor certifying. Ours is processor "
        "time from nothing to a certified plan. Widths are those of the narrow passages; Dubins curves of "
        "the table's tightest radius."
    ]
    return Section("Planner: OMPL's own benchmark", ["width", "ours", *METHODS], rows, notes)

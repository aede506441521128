"""OMPL's benchmark (`ompl.tools.Benchmark`) of planners on one planning problem."""

from __future__ import annotations

import contextlib
import io
import sqlite3
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeVar, cast

from planners.plan.certify import certify
from planners.plan.registry import Effort, planner_named
from planners.search.ompl_problem import cycle_setup, gaits_of
from planners.search.ompl_setup import seeded
from planners.search.problem import Problem
from srs_opt import plugins
from srs_opt.errors import NoAnswerError
from srs_opt.files import temporary_folder
from srs_opt.interrupts import signals_deferred, workers_deaf_to_interrupts

T = TypeVar("T")
QUERY = (
    "select c.name, r.time, r.solved, r.correct_solution "
    "from runs r join plannerConfigs c on c.id = r.plannerid order by r.id"
)
ENOUGH = 10**6  # iterations: OMPL's clock ends a run


@dataclass(frozen=True)
class Run:
    """One run of a planner.

    Attributes
    ----------
    planner : str
    time_s : float
        By OMPL's clock, without certificate.
    solved : bool
        By what OMPL says.
    duration_s : float or None
        Of the plan, where its certificate passed.
    """

    planner: str
    time_s: float
    solved: bool
    duration_s: float | None


def benchmark(
    problem: Problem, names: Sequence[str], runs: int, limit_s: float, seed: int
) -> tuple[str, list[Run]]:
    """Return OMPL's log and the runs, from a process of its own: OMPL's planners may take it down.

    Raises
    ------
    NoAnswerError
        If they do.
    """
    given = (problem, tuple(names), runs, limit_s, seed)
    log, found = in_own_process(benchmark_here, *given, what=f"{problem.maze.name}: {', '.join(names)}")
    return log, found


def in_own_process(call: Callable[..., T], *given: Any, what: str) -> T:
    """Return what a call returns, made in a process of its own: OMPL's planners may take it down.

    Raises
    ------
    NoAnswerError
        If they do; `what` says of what.
    """
    context = get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(sender, plugins.files(), call, given))
    try:
        with workers_deaf_to_interrupts(), signals_deferred():
            process.start()
        sender.close()
        return cast(T, receiver.recv())
    except EOFError:
        raise NoAnswerError(f"{what}: a planner crashed its process") from None
    finally:
        process.terminate()  # an orderly end would list what OMPL's bindings forget to free
        process.join()


def _send(
    sender: Connection, files: Sequence[Path], call: Callable[..., object], given: Sequence[object]
) -> None:
    for file in files:
        plugins.load_plugin(file)
    sender.send(call(*given))


def benchmark_here(
    problem: Problem, names: Sequence[str], runs: int, limit_s: float, seed: int
) -> tuple[str, list[Run]]:
    """Return what `benchmark` does, in this process."""
    from ompl import tools

    seeded(seed)
    cycles = cycle_setup(problem)
    assert problem.to_goal.seconds.size  # what every planner shares is made before the clock runs
    effort = Effort(ENOUGH, seed, lambda: False)
    bench = tools.Benchmark(cycles.setup, problem.maze.name)
    for name in names:
        bench.addPlanner(planner_named(name).as_ompl(cycles, effort))
    durations: list[float | None] = []  # OMPL keeps no property that Python adds

    def certified(planner: Any, _: Any) -> None:
        definition = planner.getProblemDefinition()
        gaits = gaits_of(problem, definition.getSolutionPath()) if definition.hasExactSolution() else None
        certificate = None if gaits is None else certify(problem, gaits)
        passed = certificate is not None and certificate.passed
        durations.append(float(certificate.time_s[-1]) if passed and certificate is not None else None)

    bench.setPreRunEvent(lambda planner: cycles.memory.forget())
    bench.setPostRunEvent(certified)
    bench.benchmark(
        tools.Request(
            limit_s,
            runCount=runs,
            timeBetweenUpdates=0.0,  # no second thread: Python checks validity in this one
            displayProgress=False,
            saveConsoleOutput=False,
            simplify=False,
        )
    )
    log, found = recorded(bench)
    return log, [Run(*run[:3], duration) for run, duration in zip(found, durations)]


def recorded(bench: Any) -> tuple[str, list[tuple[str, float, bool, bool]]]:
    """Return OMPL's log and, read from it as OMPL's own tools read it, every run.

    A run is the planner's name, its time (s), whether OMPL calls it exact, and whether its path passes
    OMPL's own check.
    """
    from ompl import tools

    with temporary_folder() as scratch:
        log, rows = scratch / "runs.log", scratch / "runs.db"
        bench.saveResultsToFile(str(log))
        with contextlib.redirect_stdout(io.StringIO()):  # it tells what it parses
            tools.readBenchmarkLog(str(rows), [str(log)], False)
        with contextlib.closing(sqlite3.connect(rows)) as base:
            found = [
                (name.removeprefix("control_").removeprefix("geometric_"), time, bool(exact), bool(right))
                for name, time, exact, right in base.execute(QUERY)
            ]
        return log.read_text(encoding="utf-8"), found

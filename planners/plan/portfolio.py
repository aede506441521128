"""Which planner answers: one by name, or the portfolio.

The portfolio goes in rounds of counted work. In a round our own searches look first, in this process; only
when they have found nothing do OMPL's planners get their iterations, each in a process of its own. The
first round with a certified plan ends it, and within a round the order of the registry decides, not the
clock: the same seed gives the same plan. The time limit is a guard.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor
from concurrent.futures import TimeoutError as LateError  # the built-in one only from Python 3.11 on
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from planners.plan.answer import Plan, PlanResult
from planners.plan.certify import certify
from planners.plan.registry import OMPLS, OURS, Effort, Planner, planner_named
from planners.plan.settings import PORTFOLIO
from planners.plan.solve import TOO_NARROW, LatticeSolver
from planners.search.beam import BEAM
from planners.search.costmap import BLOCKED_S
from planners.search.ompl_setup import MISSING, has_ompl
from planners.search.problem import Problem
from srs_opt import plugins
from srs_opt.interrupts import signals_deferred, workers_deaf_to_interrupts


@dataclass(frozen=True)
class PlanRequest:
    """What the user asked for.

    Attributes
    ----------
    planner : str
        "auto" or one planner's name.
    seed : int
    time_limit_s : float
    best : bool
        Go on looking for faster plans until the time limit.
    """

    planner: str = "auto"
    seed: int = 0
    time_limit_s: float = 60.0
    best: bool = False


Tell = Callable[[str], None]


def solve(problem: Problem, request: PlanRequest, tell: Tell = lambda message: None) -> PlanResult:
    """Return the answer of the wanted planner, or of the portfolio.

    Raises
    ------
    InputError
        If there is no such planner.
    """
    began = time.perf_counter()
    if request.planner == "auto":
        result = _rounds(problem, request, tell)
    else:
        planner = planner_named(request.planner)
        if planner.solver is not None:
            result = planner.solver(problem, time_limit_s=request.time_limit_s, tell=tell).run()
        else:
            result = _alone(problem, request, planner, tell)
    if request.best and result.plan is not None:
        result = _better(problem, request, result, tell)
    return replace(result, planning_s=time.perf_counter() - began)


def _rounds(problem: Problem, request: PlanRequest, tell: Tell) -> PlanResult:
    makers = [planner_named(name).solver for name in OURS]
    options = {"time_limit_s": request.time_limit_s, "tell": tell}
    lattice, runs, *others = [make(problem, **options) for make in makers if make]
    ours = [lattice, runs, *others]
    lattice.hand_over = True
    began = time.perf_counter()
    start = np.array([problem.start.x, problem.start.y])
    way_s = float(problem.to_goal.at(start))
    first = PORTFOLIO.first_nodes
    if way_s <= BLOCKED_S / 2:
        first = max(first, round(PORTFOLIO.nodes_per_s * way_s))
    for solver, nodes in ((lattice, first), (runs, PORTFOLIO.run_nodes)):
        result = solver.run(nodes)
        if result.plan is not None or result.status == "infeasible":
            return result
    for turn in range(PORTFOLIO.rounds):
        narrow = None
        for solver in ours:
            result = solver.run(first * 2**turn)
            if result.plan is not None or result.status == "infeasible":
                return result
            narrow = result if result.reason == TOO_NARROW else narrow
        if narrow is not None:  # all of ours have looked at it: others need more room
            return narrow
        if all(solver.ended for solver in ours):
            return result
        left = request.time_limit_s - (time.perf_counter() - began)
        if left <= 0:
            return result
        if not has_ompl():
            if not turn:
                tell(f"{MISSING}: continuing with the built-in searches")
            continue
        tell(f"lattice: nothing among {ours[0].looked_at} cycles; trying OMPL's planners as well")
        plan = _ompl_round(problem, request, PORTFOLIO.first_iterations * 2**turn, left)
        if plan is not None:
            return PlanResult("solved", plan, None, 0.0, result.effort)
    return result


def _ompl_round(problem: Problem, request: PlanRequest, iterations: int, left_s: float) -> Plan | None:
    """Return the plan of the first planner in order that has a certified one."""
    deadline = time.perf_counter() + left_s
    with ExitStack() as processes:  # one each: a planner that crashes takes no other with it
        pools = [processes.enter_context(_worker()) for _ in OMPLS]
        with workers_deaf_to_interrupts(), signals_deferred():
            futures = [
                pool.submit(found_apart, problem, name, iterations, request.seed)
                for pool, name in zip(pools, OMPLS)
            ]
        for name, future in zip(OMPLS, futures):
            plan = _certified(problem, name, _result(future, deadline - time.perf_counter()))
            if plan is not None:
                return plan
    return None


def _result(future: Future[tuple[int, ...] | None], left_s: float) -> tuple[int, ...] | None:
    """Return what a planner found; nothing when it is late or crashed its process."""
    try:
        return future.result(max(0.1, left_s))
    except (TimeoutError, LateError, BrokenExecutor):
        return None


def _alone(problem: Problem, request: PlanRequest, planner: Planner, tell: Tell) -> PlanResult:
    """Return the answer of one planner, in rounds with fresh seeds."""
    began = time.perf_counter()
    for turn in range(PORTFOLIO.rounds):
        left = request.time_limit_s - (time.perf_counter() - began)
        if left <= 0:
            break
        iterations = PORTFOLIO.first_iterations * 2**turn
        gaits = _found(problem, planner, iterations, request.seed + turn, left)
        plan = _certified(problem, planner.name, gaits)
        if plan is not None:
            return PlanResult("solved", plan, None, 0.0, {"iterations": iterations})
        tell(f"{planner.name}: no certified plan in {iterations} iterations")
    late = time.perf_counter() - began >= request.time_limit_s
    limit = f"within the time limit of {request.time_limit_s:g} s"
    within = limit if late else f"in {PORTFOLIO.rounds} rounds"
    reason = f"{planner.name} found no plan that passes the certificate {within}; other planners may"
    return PlanResult("timeout" if late else "not_found", None, reason, 0.0, {"rounds": turn + 1})


def _found(
    problem: Problem, planner: Planner, iterations: int, seed: int, left_s: float
) -> tuple[int, ...] | None:
    """Return what a planner finds, in a process of its own where it may take it down."""
    if not planner.apart:
        ends = time.perf_counter() + left_s
        return planner.find(problem, Effort(iterations, seed, lambda: time.perf_counter() > ends))
    with _worker() as pool:
        with workers_deaf_to_interrupts(), signals_deferred():
            future = pool.submit(found_apart, problem, planner.name, iterations, seed)
        return _result(future, left_s)


def found_apart(problem: Problem, name: str, iterations: int, seed: int) -> tuple[int, ...] | None:
    """Return the gaits of a planner's way, or None (runs in a process of its own)."""
    return planner_named(name).find(problem, Effort(iterations, seed, lambda: False))


def _certified(problem: Problem, planner: str, gaits: tuple[int, ...] | None) -> Plan | None:
    if gaits is None:
        return None
    certificate = certify(problem, gaits)
    return Plan(planner, gaits, certificate) if certificate.passed else None


def _better(problem: Problem, request: PlanRequest, result: PlanResult, tell: Tell) -> PlanResult:
    """Search with wider beams as long as there is time; keep the cheapest plan."""
    began = time.perf_counter()
    best = result
    for width in PORTFOLIO.wider:
        left = request.time_limit_s - (time.perf_counter() - began)
        if left <= 0:
            break
        solver = LatticeSolver(problem, beams=(replace(BEAM, width=width),), time_limit_s=left, tell=tell)
        other = solver.run()
        assert best.plan is not None  # the caller has looked
        if other.plan is not None and other.plan.cost(problem) < best.plan.cost(problem):
            tell(f"better with a beam of {width}: {other.plan.duration_s:.2f} s, {other.plan.length_m:.2f} m")
            best = other
    return best


@contextmanager
def _worker() -> Iterator[ProcessPoolExecutor]:
    """Lend a fresh process that is ended for good afterwards, whatever it is doing."""
    pool = ProcessPoolExecutor(
        1, mp_context=get_context("spawn"), initializer=_load_plugins, initargs=(plugins.files(),)
    )
    try:
        yield pool
    finally:
        processes = list((pool._processes or {}).values())
        pool.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.terminate()


def _load_plugins(files: tuple[Path, ...]) -> None:
    for file in files:
        plugins.load_plugin(file)

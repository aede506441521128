"""Which planner answers: one by name, or the portfolio.

The portfolio goes in rounds of counted work. In a round the lattice search looks first, in this process;
only when it has found nothing do OMPL's planners get their iterations, each in a process of its own. The
first round with a certified plan ends it, and within a round the order of PLANNERS decides, not the
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

from planners.plan.answer import Plan, PlanResult
from planners.plan.certify import certify
from planners.plan.solve import BEAM, LEAST_SLACK_M, TOO_NARROW, LatticeSolver
from planners.search.lattice import LatticeSettings
from planners.search.problem import Problem
from planners.search.tree import Step
from srs_opt.parallel.interrupts import workers_deaf_to_interrupts

CONTROL = ("rrt", "est", "kpiece")
PLANNERS = ("lattice", "dubins-rrtconnect", "rs-rrtconnect", "kpiece", "est", "rrt")
FIRST_NODES = 3000  # cycles that the lattice search looks at in the first round; doubled every round
FIRST_ITERATIONS = 1000  # of an OMPL planner
ROUNDS = 5
HALVINGS = 3  # of cells near walls, in the second lattice search
WIDER = (50, 150, 500, 1500)  # beams that look for better plans


@dataclass(frozen=True)
class Wish:
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


def solve(problem: Problem, wish: Wish, tell: Tell = lambda message: None) -> PlanResult:
    """Return the answer of the wanted planner, or of the portfolio."""
    began = time.perf_counter()
    if wish.planner == "lattice":
        result = LatticeSolver(problem, time_limit_s=wish.time_limit_s, tell=tell).run()
    elif wish.planner == "auto":
        result = _rounds(problem, wish, tell)
    else:
        result = _ompl_alone(problem, wish, tell)
    if wish.best and result.plan is not None:
        result = _better(problem, wish, result, tell)
    return replace(result, planning_s=time.perf_counter() - began)


def _rounds(problem: Problem, wish: Wish, tell: Tell) -> PlanResult:
    lattice = LatticeSolver(problem, time_limit_s=wish.time_limit_s, tell=tell)
    # the second search tells places near walls apart more finely: slower, but it threads needles
    fine = LatticeSolver(
        problem,
        LatticeSettings(most_halvings=HALVINGS, by_heading=True, slack_m=LEAST_SLACK_M),
        beams=(),
        time_limit_s=wish.time_limit_s,
        tell=tell,
    )
    began = time.perf_counter()
    for turn in range(ROUNDS):
        for solver in (lattice, fine):
            result = solver.run(FIRST_NODES * 2**turn)
            if result.plan is not None or result.status == "infeasible" or result.reason == TOO_NARROW:
                return result
        if lattice.ended and fine.ended:
            return result
        left = wish.time_limit_s - (time.perf_counter() - began)
        if left <= 0:
            return result
        tell(f"lattice: nothing among {lattice.looked_at} cycles; OMPL's planners look too")
        plan = _ompl_round(problem, wish, FIRST_ITERATIONS * 2**turn, left)
        if plan is not None:
            return PlanResult("solved", plan, None, 0.0, result.effort)
    return result


def _ompl_round(problem: Problem, wish: Wish, iterations: int, left_s: float) -> Plan | None:
    """Return the plan of the first planner in order that has a certified one."""
    deadline = time.perf_counter() + left_s
    names = [name for name in PLANNERS if name != "lattice"]
    with ExitStack() as processes:  # one each: a planner that crashes takes no other with it
        pools = [processes.enter_context(_worker()) for _ in names]
        with workers_deaf_to_interrupts():
            futures = [
                pool.submit(ompl_gaits, problem, name, iterations, wish.seed)
                for pool, name in zip(pools, names)
            ]
        for name, future in zip(names, futures):
            plan = _certified(problem, name, _result(future, deadline - time.perf_counter()))
            if plan is not None:
                return plan
    return None


def _result(future: Future[tuple[int, ...] | None], left_s: float) -> tuple[int, ...] | None:
    """Return what a planner found; nothing when it is late or took its process down."""
    try:
        return future.result(max(0.1, left_s))
    except (TimeoutError, LateError, BrokenExecutor):
        return None


def _ompl_alone(problem: Problem, wish: Wish, tell: Tell) -> PlanResult:
    """Return the answer of one OMPL planner, in a process of its own, in rounds with fresh seeds."""
    began = time.perf_counter()
    for turn in range(ROUNDS):
        left = wish.time_limit_s - (time.perf_counter() - began)
        if left <= 0:
            break
        iterations = FIRST_ITERATIONS * 2**turn
        with _worker() as pool:
            with workers_deaf_to_interrupts():
                future = pool.submit(ompl_gaits, problem, wish.planner, iterations, wish.seed + turn)
            gaits = _result(future, left)
        plan = _certified(problem, wish.planner, gaits)
        if plan is not None:
            return PlanResult("solved", plan, None, 0.0, {"iterations": iterations})
        tell(f"{wish.planner}: no certified plan in {iterations} iterations")
    late = time.perf_counter() - began >= wish.time_limit_s
    within = f"within the time limit of {wish.time_limit_s:g} s" if late else f"in {ROUNDS} rounds"
    reason = f"{wish.planner} found no plan that passes the certificate {within}; other planners may"
    return PlanResult("timeout" if late else "not_found", None, reason, 0.0, {"rounds": turn + 1})


def ompl_gaits(problem: Problem, planner: str, iterations: int, seed: int) -> tuple[int, ...] | None:
    """Return the gaits of an OMPL planner's way, or None (runs in a process of its own)."""
    from planners.search.ompl_control import search_control
    from planners.search.ompl_geometric import search_geometric

    way: list[Step] | None
    if planner in CONTROL:
        way = search_control(problem, planner, iterations, seed)
    else:
        way = search_geometric(problem, planner, iterations, seed)
    return None if way is None else tuple(step.gait for step in way)


def _certified(problem: Problem, planner: str, gaits: tuple[int, ...] | None) -> Plan | None:
    if gaits is None:
        return None
    certificate = certify(problem, gaits)
    return Plan(planner, gaits, certificate) if certificate.passed else None


def _better(problem: Problem, wish: Wish, result: PlanResult, tell: Tell) -> PlanResult:
    """Search with wider beams as long as there is time; keep the cheapest plan."""
    began = time.perf_counter()
    best = result
    for width in WIDER:
        left = wish.time_limit_s - (time.perf_counter() - began)
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
    pool = ProcessPoolExecutor(1, mp_context=get_context("spawn"))
    try:
        yield pool
    finally:
        processes = list((pool._processes or {}).values())
        pool.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.terminate()

"""The whole search for a manoeuvre: starts, local optima with friction ever less smoothed, ticks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.manoeuvre.breeding import bred
from srs_opt.manoeuvre.certificate import Certificate, certify
from srs_opt.manoeuvre.solve import SATISFIED_M, Candidate, Solver, smoothed
from srs_opt.manoeuvre.starts import playable, starts
from srs_opt.manoeuvre.task import Task
from srs_opt.manoeuvre.ticks import on_ticks
from srs_opt.manoeuvre.valves import ValvePlan, ValveRow
from srs_opt.simulate.integrate import Integrator, Trajectory

Tell = Callable[[str], None]
# Of friction, for a start's first steps: sticking links do not feel small changes of their valves
COARSE_FRICTION_M_S = 0.02
COARSE_STEPS, FIRST_STEPS, LAST_STEPS = 8, 14, 60
ROUGH_STEP_S = 0.0025  # of starts and softened friction
FINE_STEP_S = 0.0005  # of ticks: errs by less than a tenth of a millimetre per metre
POOL = 4  # optima that are perturbed; more spreads the effort, one gets stuck
SHAKE_S, SHAKE_SHARE, SHAKE_KPA = (0.015, 0.035), 0.03, 2.0
CLOSE = 0.015  # share of the best merit within which a perturbed optimum is refined


@dataclass(frozen=True)
class Manoeuvre:
    """The answer.

    Attributes
    ----------
    plan : ValvePlan
    certificate : Certificate
    trajectory : Trajectory
        Of the certificate's simulation.
    exact_s : float
        Duration before the switches were put on ticks.
    first_s : float
        Duration of the best start that the optimization had.
    starts, solves : int
    """

    plan: ValvePlan
    certificate: Certificate
    trajectory: Trajectory
    exact_s: float
    first_s: float
    starts: int
    solves: int


def find(
    run: Integrator,
    task: Task,
    gaits: Sequence[Gait],
    count: int = 8,
    populations: int = 2,
    shakes: int = 24,
    seed: int = 0,
    tell: Tell = lambda message: None,
) -> Manoeuvre:
    """Return the best manoeuvre found for a task, certified.

    Parameters
    ----------
    run : Integrator
    gaits : sequence of Gait
        Tried as starts beside random waves.
    count, populations, shakes : int
        Steady waves that are optimized, populations of waves that change on the way, and perturbations of the
        best optima that are optimized again.

    Raises
    ------
    NoAnswerError
        If nothing that reaches the end is found.
    """
    solver = Solver(run, task)
    rough = Solver(run, task, ROUGH_STEP_S)
    begun = starts(rough, gaits, count, seed)
    if not begun:
        raise NoAnswerError("no wave gait comes near the end of this manoeuvre; allow more time (--longest)")
    soft = Solver(smoothed(run, COARSE_FRICTION_M_S), task, ROUGH_STEP_S)
    pool: list[Candidate] = []
    for k, start in enumerate(begun):
        plan = soft.solve(start.plan, COARSE_STEPS).plan
        pool.append(solver.solve(plan, FIRST_STEPS))
        tell(
            f"start {k + 1} of {len(begun)}: {start.plan.duration_s:.3f} s -> {_word(min(pool, key=_merit))}"
        )
    for k in range(populations):
        population = bred(rough, begun[0], seed + k)
        pool.append(solver.solve(population.plan, FIRST_STEPS))
        tell(f"population {k + 1} of {populations}: {_word(population)} -> {_word(pool[-1])}")
    pool = sorted(pool, key=_merit)[:POOL]
    pool[0] = solver.solve(pool[0].plan, LAST_STEPS)
    rng = np.random.default_rng(seed)
    for k in range(shakes):
        base = pool[k // 2 % len(pool)] if k % 2 else pool[0]
        found = solver.solve(shaken(task, base.plan, rng, SHAKE_S[k // 2 % 2]), FIRST_STEPS)
        if found.merit < pool[0].merit * (1 + CLOSE):
            found = solver.solve(found.plan, LAST_STEPS)
        if found.merit < pool[0].merit:
            tell(f"perturbation {k + 1} of {shakes}: {_word(found)}")
        pool = sorted([*pool, found], key=_merit)[:POOL]
    fine = Solver(run, task, FINE_STEP_S)
    answers = []
    for candidate in pool[:2]:
        final = on_ticks(fine, candidate.plan)
        answers.append((final, candidate, *certify(run, task, final.plan)))
    final, exact, certificate, trajectory = min(answers, key=lambda a: (not a[2].passed, a[0].merit))
    if final.worst_m > 100 * SATISFIED_M:
        raise NoAnswerError(
            f"nothing found reaches the end: the best misses by {1e3 * final.worst_m:.0f} mm; "
            "allow more time (--longest), room or pressure, or try more --starts"
        )
    solves = 2 * len(begun) + populations + 1 + shakes
    return Manoeuvre(
        final.plan,
        certificate,
        trajectory,
        exact.plan.duration_s,
        begun[0].plan.duration_s,
        len(begun),
        solves,
    )


def shaken(task: Task, plan: ValvePlan, rng: np.random.Generator, by_s: float) -> ValvePlan:
    """Return a plan with every switch moved at random, all of it stretched a little, at another pressure."""
    stretch = 1 + SHAKE_SHARE * rng.standard_normal()
    times = (plan.times() + by_s * rng.standard_normal(plan.switches)) * stretch
    pressure = np.clip(plan.pressure_kpa + SHAKE_KPA * rng.standard_normal(), *task.bounds.pressure_kpa)
    if not task.pressure_is_free:
        pressure = plan.pressure_kpa
    moved = plan.with_times(times, plan.duration_s * stretch, float(pressure))
    rows = tuple(ValveRow(row.states, tuple(sorted(row.times_s))) for row in moved.rows)
    return playable(task, replace(moved, rows=rows).trimmed())


def _merit(candidate: Candidate) -> float:
    return candidate.merit


def _word(candidate: Candidate) -> str:
    missed = f", misses by {1e3 * candidate.worst_m:.1f} mm" if candidate.worst_m > SATISFIED_M else ""
    return f"{candidate.plan.duration_s:.3f} s{missed}"

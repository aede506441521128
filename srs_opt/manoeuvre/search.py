"""The whole search for a manoeuvre: starts, local optima with friction ever less smoothed, ticks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.manoeuvre.certificate import Certificate, certify
from srs_opt.manoeuvre.settings import MANOEUVRE_SEARCH, MANOEUVRE_SOLVER
from srs_opt.manoeuvre.solve import Candidate, Solver, smoothed
from srs_opt.manoeuvre.starts import playable, starts
from srs_opt.manoeuvre.task import Task
from srs_opt.manoeuvre.ticks import on_ticks
from srs_opt.manoeuvre.valves import ValvePlan, ValveRow
from srs_opt.manoeuvre.wave_population import evolved
from srs_opt.simulate.integrate import Integrator, Trajectory

Tell = Callable[[str], None]


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
    perturbations: int = 24,
    seed: int = 0,
    tell: Tell = lambda message: None,
) -> Manoeuvre:
    """Return the best manoeuvre found for a task, certified.

    Parameters
    ----------
    run : Integrator
    gaits : sequence of Gait
        Tried as starts beside random waves.
    count, populations, perturbations : int
        Steady waves that are optimized, populations of waves that change on the way, and perturbations of the
        best optima that are optimized again.

    Raises
    ------
    InputError
        If an effect of the robot goes by a gait's frequency.
    NoAnswerError
        If nothing that reaches the end is found.
    """
    run.check_played_once()
    satisfied_m = MANOEUVRE_SOLVER.satisfied * run.robot.length_m
    solver = Solver(run, task)
    rough = Solver(run, task, MANOEUVRE_SEARCH.rough_step_s)
    begun = starts(rough, gaits, count, seed)
    if not begun:
        raise NoAnswerError("no wave gait comes near the end of this manoeuvre; allow more time (--longest)")
    soft = Solver(smoothed(run, MANOEUVRE_SEARCH.coarse_friction_m_s), task, MANOEUVRE_SEARCH.rough_step_s)
    pool: list[Candidate] = []
    for k, start in enumerate(begun):
        plan = soft.solve(start.plan, MANOEUVRE_SEARCH.coarse_steps).plan
        pool.append(solver.solve(plan, MANOEUVRE_SEARCH.first_steps))
        tell(
            f"start {k + 1} of {len(begun)}: {start.plan.duration_s:.3f} s -> "
            f"{_word(min(pool, key=_merit), satisfied_m)}"
        )
    for k in range(populations):
        population = evolved(rough, begun[0], seed + k)
        pool.append(solver.solve(population.plan, MANOEUVRE_SEARCH.first_steps))
        tell(
            f"population {k + 1} of {populations}: {_word(population, satisfied_m)} -> "
            f"{_word(pool[-1], satisfied_m)}"
        )
    pool = sorted(pool, key=_merit)[: MANOEUVRE_SEARCH.pool]
    pool[0] = solver.solve(pool[0].plan, MANOEUVRE_SEARCH.last_steps)
    rng = np.random.default_rng(seed)
    spreads = MANOEUVRE_SEARCH.perturbations_s
    for k in range(perturbations):
        # every other perturbation is of the best, the rest of all in turn
        base = pool[k // 2 % len(pool)] if k % 2 else pool[0]
        found = solver.solve(
            perturbed(task, base.plan, rng, spreads[k // 2 % len(spreads)]),
            MANOEUVRE_SEARCH.first_steps,
        )
        if found.merit < pool[0].merit * (1 + MANOEUVRE_SEARCH.refined_share):
            found = solver.solve(found.plan, MANOEUVRE_SEARCH.last_steps)
        if found.merit < pool[0].merit:
            tell(f"perturbation {k + 1} of {perturbations}: {_word(found, satisfied_m)}")
        pool = sorted([*pool, found], key=_merit)[: MANOEUVRE_SEARCH.pool]
    # a tick moves the end by less than the rougher steps err
    fine = Solver(run, task, MANOEUVRE_SEARCH.fine_step_s)
    answers = []
    for candidate in pool[:2]:
        final = on_ticks(fine, candidate.plan)
        answers.append((final, candidate, *certify(run, task, final.plan)))
    final, exact, certificate, trajectory = min(answers, key=lambda a: (not a[2].passed, a[0].merit))
    if final.worst_m > 100 * satisfied_m:
        raise NoAnswerError(
            f"nothing found reaches the end: the best misses by {1e3 * final.worst_m:.0f} mm; "
            "allow more time (--longest), room or pressure, or try more --starts"
        )
    solves = 2 * len(begun) + populations + 1 + perturbations
    return Manoeuvre(
        final.plan,
        certificate,
        trajectory,
        exact.plan.duration_s,
        begun[0].plan.duration_s,
        len(begun),
        solves,
    )


def perturbed(task: Task, plan: ValvePlan, rng: np.random.Generator, by_s: float) -> ValvePlan:
    """Return a plan with every switch moved at random, all of it stretched a little, at another pressure."""
    stretch = 1 + MANOEUVRE_SEARCH.perturbation_stretch * rng.standard_normal()
    times = (plan.times() + by_s * rng.standard_normal(plan.switches)) * stretch
    pressure = np.clip(
        plan.pressure_kpa + MANOEUVRE_SEARCH.perturbation_kpa * rng.standard_normal(),
        *task.bounds.pressure_kpa,
    )
    if not task.pressure_is_free:
        pressure = plan.pressure_kpa
    moved = plan.with_times(times, plan.duration_s * stretch, float(pressure))
    # switches that were moved may have passed each other
    rows = tuple(ValveRow(row.states, tuple(sorted(row.times_s))) for row in moved.rows)
    return playable(task, replace(moved, rows=rows).trimmed())


def _merit(candidate: Candidate) -> float:
    return candidate.merit


def _word(candidate: Candidate, satisfied_m: float) -> str:
    missed = f", misses by {1e3 * candidate.worst_m:.1f} mm" if candidate.worst_m > satisfied_m else ""
    return f"{candidate.plan.duration_s:.3f} s{missed}"

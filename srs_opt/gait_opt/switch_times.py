"""Exact switch times: multi-phase collocation in a fixed order, orders exchanged where a phase vanishes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.explain import explained
from srs_opt.gait_opt.collocation.guess import gait_from, switches_of, unknowns_from_orbits
from srs_opt.gait_opt.collocation.layout import WEIGHTS, Mesh
from srs_opt.gait_opt.collocation.phases import Cuts, exchanged, phase_cuts, phase_times, switch_order
from srs_opt.gait_opt.collocation.point import AHEAD, ASIDE
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.collocation.program import Program
from srs_opt.gait_opt.collocation.refine import defects, refined_cuts
from srs_opt.gait_opt.continuation import Report, Stage, Step, bounded, elements_until, orbits_of
from srs_opt.gait_opt.prices import Price, prices
from srs_opt.gait_opt.score import Score, score
from srs_opt.gait_opt.search_settings import SWITCH_TIMES
from srs_opt.orbit.steady import Orbit
from srs_opt.simulate.settings import MOTION

# the start is near: let the barrier begin low and push nothing off its limits
_IPOPT = {
    "mu_strategy": "monotone", "mu_init": 1e-6, "bound_push": 1e-6, "bound_frac": 1e-6, "max_iter": 100,
    "tol": 1e-5,
}  # fmt: skip
_MOTION = ("speed", "turn_rate")


@dataclass(frozen=True)
class ExactSwitchTimes:
    """The result.

    Attributes
    ----------
    gait : Gait
    orbits : tuple of Orbit, one per robot
    score : Score
    claimed_m_s : tuple of float
        The robots' speeds by the last solve that simulation confirmed.
    steps : tuple of Step
    prices : tuple of Price
        What the active limits cost there.
    """

    gait: Gait
    orbits: tuple[Orbit, ...]
    score: Score
    claimed_m_s: tuple[float, ...]
    steps: tuple[Step, ...]
    prices: tuple[Price, ...] = ()


def optimize_switch_times(
    problem: CycleProblem, gait: Gait, reach: float = 0.02, report: Report | None = None
) -> ExactSwitchTimes:
    """Return the gait with locally optimal switch times, frequency and pressure.

    Each round solves one fixed order of switches on one mesh, within reach; where that binds, the next
    reaches further: ticks hardly change an optimum's speed, but that of a gait on its way there. Switches
    that met exchange their order for the next round; phases in which the polynomials disobey the equations
    between nodes get more elements.
    """
    orbits = orbits_of(problem, gait)
    best = score(problem, gait, orbits)
    claimed = tuple(o.speed_m_s for o in orbits)
    steps: list[Step] = []
    cost: tuple[Price, ...] = ()
    order = switch_order(_switches(gait))
    cuts = phase_cuts(_switches(gait), order, *elements_until(orbits, SWITCH_TIMES.elements))
    for _ in range(SWITCH_TIMES.rounds):
        trial, step, speeds, met, finer, binding, active = _solve(problem, gait, orbits, order, cuts, reach)
        try:
            trial_orbits = orbits_of(problem, trial)
        except NoAnswerError:
            reach /= 3
            continue
        found = score(problem, trial, trial_orbits)
        step = replace(step, simulated_m_s=trial_orbits[0].speed_m_s)
        steps.append(step)
        gain = found.total - best.total
        if not step.trouble and gain > -SWITCH_TIMES.loss * best.scale:
            claimed, cost = speeds, active
        if gain > 0:
            gait, orbits, best = trial, trial_orbits, found
        if report is not None:
            report(step, best)
        settled = met is None and finer is cuts and not step.trouble
        if settled and (gain <= SWITCH_TIMES.gain * best.scale or not binding):
            break
        cuts = finer
        if gain > 0 and met is not None:
            order = met
            cuts = phase_cuts(_switches(gait), order, *elements_until(orbits, sum(c.size - 1 for c in cuts)))
        elif gain <= 0:
            reach /= 3
        if gain > 0 and binding:
            reach *= 2
    return ExactSwitchTimes(gait, orbits, best, claimed, tuple(steps), cost)


def collocated_speeds(problem: CycleProblem, gait: Gait) -> tuple[float, ...] | None:
    """Return the robots' speeds by collocation with the gait held; None where that does not converge.

    On phases between switches, so that ticks are no obstacle; what is wanted of the gait does not enter.
    """
    orbits = orbits_of(problem, gait)
    order = switch_order(_switches(gait))
    cuts = phase_cuts(_switches(gait), order, *elements_until(orbits, SWITCH_TIMES.most_elements))
    mesh, times = phase_times(_switches(gait), order, cuts)
    p = problem.program(mesh.elements, times)
    z, scales = unknowns_from_orbits(p.layout, list(problem.robots), list(orbits), mesh)
    z[p.layout.merit] = score(problem, gait, orbits).merit
    parameters = problem.parameters(p, mesh, scales, max(r.friction_speed_m_s for r in problem.robots))
    (low, high), (row_low, row_high) = problem.bounds(p)
    held = slice(0, 2 + p.layout.switches)
    free = [p.layout.unknown(r, name) for r in range(len(orbits)) for name in _MOTION]
    # the gait is a constant here, the motion alone is solved for
    low[held] = high[held] = z[held]
    low[free], high[free] = -np.inf, np.inf
    wishes = slice(row_low.size - len(p.goal.names), None)
    merits = np.array(p.goal.names) == "merit"
    # what is wanted of the gait is dropped; the merit's row stays, or the merit would be unbounded
    row_low[wishes], row_high[wishes] = np.where(merits, 0.0, -np.inf), np.inf
    rows = (row_low, row_high)
    solution = p.solve(z, parameters, (low, high), rows, options=_IPOPT, solver=problem.solver)
    if not solution.converged:
        return None
    return _path_speeds(problem, p, solution.z, scales, mesh)


def _path_speeds(
    problem: CycleProblem, p: Program, z: np.ndarray, scales: list[np.ndarray], mesh: Mesh
) -> tuple[float, ...]:
    """Return the robots' speeds as simulation defines them: turn rate times mean distance from the centre.

    The program's own speed is that of the mean place in the turning frame, whose distance from the centre is
    smaller than the mean distance where the body swings about as far as the radius of its turn.
    """
    weights = (np.diff(mesh.edges)[:, None] * WEIGHTS).ravel()
    speeds = []
    for r in range(len(problem.robots)):
        speed, turn = (float(z[p.layout.unknown(r, name)]) for name in _MOTION)
        if abs(turn) * MOTION.straight_radius_m > abs(speed):
            states = z[p.layout.states(r)].reshape(p.layout.points, -1) * scales[r]
            ahead, aside = states[:, AHEAD], states[:, ASIDE]
            # the centre of rotation lies speed/turn to the left of the mean place
            distance = float(weights @ np.hypot(ahead, aside - speed / turn))
            speed = float(np.copysign(abs(turn) * distance, speed))
        speeds.append(speed)
    return tuple(speeds)


def _switches(gait: Gait) -> np.ndarray:
    return switches_of(gait, gait.intervals[0][0][0])


def _solve(
    problem: CycleProblem,
    gait: Gait,
    orbits: tuple[Orbit, ...],
    order: np.ndarray,
    cuts: Cuts,
    reach: float,
) -> tuple[Gait, Step, tuple[float, ...], np.ndarray | None, Cuts, bool, tuple[Price, ...]]:
    """Solve once.

    Returns
    -------
    gait, step
    speeds : of all robots, m/s
    order : the exchanged one, None if no switches met
    cuts : refined; the same object where nothing is to refine
    binding : whether the gait wanted to move further than `reach`
    prices : what the active limits cost
    """
    own = max(r.friction_speed_m_s for r in problem.robots)
    mesh, times = phase_times(_switches(gait), order, cuts)
    p = problem.program(mesh.elements, times)
    z, scales = unknowns_from_orbits(p.layout, list(problem.robots), list(orbits), mesh)
    worth = score(problem, gait, orbits)
    z[p.layout.merit] = worth.merit / worth.scale
    parameters = problem.parameters(p, mesh, scales, own, worth.scale)
    unknowns, rows, binding = bounded(problem, p, z, reach)
    solution = p.solve(z, parameters, unknowns, rows, options=_IPOPT, solver=problem.solver)
    trial = gait_from(p.layout, solution.z)
    speeds = _path_speeds(problem, p, solution.z, scales, mesh)
    defect = defects(p, solution, parameters, mesh)
    step = Step(
        Stage(own, mesh.elements, reach), speeds[0], speeds[0], solution.iterations,
        explained(p, solution, trial), mesh.elements, float(defect.max()),
    )  # fmt: skip
    finer = cuts
    if mesh.elements < SWITCH_TIMES.most_elements and defect.max() > SWITCH_TIMES.defect:
        finer = refined_cuts(defect, cuts, SWITCH_TIMES.defect)
    met = exchanged(solution.z[2 : 2 + p.layout.switches], order)
    return trial, step, speeds, met, finer, binding(solution.z), prices(problem, p, solution, worth.scale)

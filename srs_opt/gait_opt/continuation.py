"""From a starting gait to an optimal one: continuation in the friction's smoothing, by collocation.

Friction that nearly sticks makes the problem stiff and its landscape rugged; smoothed friction does not.
Every stage starts from the *simulated* orbit of the gait so far (primal feasible whatever the mesh) and may
move the gait by a limited reach; a stage whose limits bind is repeated. What counts at the end is the
gait simulated with the robot's own friction, the best that any stage led to, never the collocation's own
number.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.explain import explained
from srs_opt.gait_opt.collocation.guess import gait_from, unknowns_from_orbits
from srs_opt.gait_opt.collocation.layout import Mesh
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.collocation.program import Program, Solution
from srs_opt.gait_opt.score import Score, score
from srs_opt.gait_opt.search_settings import CONTINUATION, ContinuationSettings
from srs_opt.gait_opt.settings import COLLOCATION
from srs_opt.orbit.steady import Orbit, steady_gait
from srs_opt.robot import Robot

_PATIENT = {"mu_strategy": "monotone", "mu_init": 1e-3, "max_iter": 80}
# simulation judges every solve: where nothing but the speed counts, a rough optimum soon is worth more than a
# sharp one late; turns and bands get stuck that way
_QUICK = {"mu_strategy": "monotone", "mu_init": 1e-4, "tol": 1e-3, "max_iter": 40}


@dataclass(frozen=True)
class Stage:
    """One stage: smoothing speed (m/s), elements of the mesh, reach of the switches (cycles), repeats.

    A `quick` stage solves to a rough tolerance and gives up early.
    """

    friction_speed_m_s: float
    elements: int
    reach: float
    repeats: int = 3
    quick: bool = False


@dataclass(frozen=True)
class Step:
    """What one solve did.

    Attributes
    ----------
    stage : Stage
    speed_m_s, simulated_m_s : float
        By collocation and by simulation at the stage's smoothing speed.
    iterations : int
    trouble : str
    astray : float
        Largest difference of the two over the robots, relative: large where simulation from rest leads to
        another orbit than the one collocated.
    """

    stage: Stage
    speed_m_s: float
    simulated_m_s: float
    iterations: int
    trouble: str = ""
    elements: int = 0
    defect: float | None = None
    astray: float = 0.0

    @staticmethod
    def of_record(record: dict[str, Any]) -> Step:
        """Return the step that ``dataclasses.asdict`` made a record of."""
        return Step(**{**record, "stage": Stage(**record["stage"])})

    @property
    def relative_error(self) -> float:
        """Collocation against simulation."""
        return abs(self.speed_m_s - self.simulated_m_s) / max(abs(self.simulated_m_s), 1e-9)


@dataclass(frozen=True)
class Continuation:
    """The result of a continuation: the gait, its orbits at the robots' own friction, the steps taken."""

    gait: Gait
    orbits: tuple[Orbit, ...]
    score: Score
    steps: tuple[Step, ...] = field(default=())

    @property
    def iterations(self) -> int:
        """IPOPT's iterations over all steps."""
        return sum(s.iterations for s in self.steps)


Bounds = tuple[np.ndarray, np.ndarray]
Report = Callable[[Step, Score], None]


def continuation_stages(
    own_m_s: float, *, quick: bool = False, settings: ContinuationSettings = CONTINUATION
) -> tuple[Stage, ...]:
    """Return the stages from strongly smoothed friction to the robot's own `own_m_s`.

    The sharper the friction, the shorter the reach over which the linearized problem holds.
    """
    if quick:
        return _quick_stages(own_m_s, settings)
    s, least_m_s = settings, settings.least_ratio * own_m_s
    stages = [Stage(v, n, s.reach, 4) for v, n in s.smooth_stages if v > least_m_s]
    stages += [Stage(*s.middle_stage, s.reach / 2, 2)] if own_m_s < s.middle_below_m_s else []
    stages += [Stage(v, s.sharp_elements, s.reach / 3, 2) for v in s.sharp_m_s if v > least_m_s]
    return (*stages, Stage(own_m_s, s.sharp_elements, s.reach / 3, 3))


def _quick_stages(own_m_s: float, settings: ContinuationSettings) -> tuple[Stage, ...]:
    """Return stages on coarse meshes, down to twice the robot's own smoothing or to that itself.

    From there the exact switch times are the better next step: they need a fine mesh only once.
    """
    speeds = [v for v in settings.quick_m_s if v > settings.least_ratio * own_m_s]
    if not speeds or speeds[-1] > 2 * own_m_s:
        speeds.append(own_m_s)
    stages = []
    for v in speeds:
        elements = next(
            (n for least, n in settings.quick_elements if v >= least), settings.finest_quick_elements
        )
        reach, repeats = (settings.reach, 4) if v >= settings.quick_smooth_m_s else (settings.reach / 2, 2)
        stages.append(Stage(v, elements, reach, repeats, quick=True))
    return tuple(stages)


def orbits_of(problem: CycleProblem, gait: Gait, friction_speed_m_s: float = 0.0) -> tuple[Orbit, ...]:
    """Return the steady orbits of all robots, friction smoothed at least by `friction_speed_m_s`."""
    smoothed = (
        replace(r, friction_speed_m_s=max(r.friction_speed_m_s, friction_speed_m_s)) for r in problem.robots
    )
    return tuple(_orbit(robot, gait, problem.model) for robot in smoothed)


@lru_cache(maxsize=16)  # where one stage ends the next begins
def _orbit(robot: Robot, gait: Gait, model: str) -> Orbit:
    return steady_gait(robot, gait, model)


def run_stages(
    problem: CycleProblem, gait: Gait, stages: tuple[Stage, ...], report: Report | None = None
) -> Continuation:
    """Return the gait that the stages lead to, from `gait`.

    Raises
    ------
    NoAnswerError
        If the starting gait itself has no steady state.
    """
    steps: list[Step] = []
    best: Continuation | None = None
    for stage in stages:
        gait, taken = _run_stage(problem, gait, stage, report)
        steps += taken
        with suppress(NoAnswerError):
            found = _judged(problem, gait)
            # judged at the robots' own friction: a later stage is no better by being later
            best = found if best is None or found.score.total > best.score.total else best
    return replace(best or _judged(problem, gait), steps=tuple(steps))


def _judged(problem: CycleProblem, gait: Gait) -> Continuation:
    """Return the gait with its orbits and score at the robots' own friction, no steps taken."""
    orbits = orbits_of(problem, gait)
    return Continuation(gait, orbits, score(problem, gait, orbits))


def _run_stage(
    problem: CycleProblem, gait: Gait, stage: Stage, report: Report | None
) -> tuple[Gait, list[Step]]:
    steps = []
    orbits = orbits_of(problem, gait, stage.friction_speed_m_s)
    best = score(problem, gait, orbits)
    reach = stage.reach
    for _ in range(stage.repeats):
        solution, p, binding = solve_from(problem, gait, orbits, stage, reach)
        trial = gait_from(p.layout, solution.z)
        try:
            trial_orbits = orbits_of(problem, trial, stage.friction_speed_m_s)
        except NoAnswerError:
            reach /= 3
            continue
        found = score(problem, trial, trial_orbits)
        speed = float(solution.z[p.layout.unknown(0, "speed")])
        trouble = explained(p, solution, trial)
        steps.append(
            Step(
                stage, speed, trial_orbits[0].speed_m_s, solution.iterations, trouble, p.layout.elements,
                astray=_astray(p, solution, trial_orbits),
            )
        )  # fmt: skip
        better = found.total > best.total
        if better:
            gait, orbits, gained, best = trial, trial_orbits, found.total - best.total, found
        if report is not None:
            report(steps[-1], best)
        if better and (not binding or gained < 1e-4 * best.scale):
            break
        if not better:
            reach /= 3
            if solution.converged and not binding:
                break
    return gait, steps


def _astray(p: Program, solution: Solution, orbits: tuple[Orbit, ...]) -> float:
    claimed = (float(solution.z[p.layout.unknown(r, "speed")]) for r in range(len(orbits)))
    return max(abs(c - o.speed_m_s) / max(abs(o.speed_m_s), 1e-9) for c, o in zip(claimed, orbits))


def mesh_for(orbits: tuple[Orbit, ...], elements: int) -> Mesh:
    """Return a mesh as dense as the steps that the simulation needed, half uniform, shared by all robots."""
    grid, level = elements_until(orbits, elements)
    return Mesh(np.interp(np.arange(elements + 1), level, grid))


def elements_until(orbits: tuple[Orbit, ...], elements: int) -> tuple[np.ndarray, np.ndarray]:
    """Return fractions of the cycle after the first switch and how many elements should end before each."""
    grid = np.linspace(0.0, 1.0, 1001)
    # the uniform share keeps elements where the motion will get sharp only later
    level = elements * CONTINUATION.uniform_share * grid
    for orbit in orbits:
        gait = orbit.gait
        times = orbit.time_s / gait.period_s
        count = np.interp(grid, times, np.arange(times.size) / (times.size - 1))
        first = gait.intervals[0][0][0] / gait.period_s
        shifted = np.interp(
            grid + first, np.concatenate([grid, grid[1:] + 1]), np.concatenate([count, count[1:] + 1])
        )
        level = level + elements * (1 - CONTINUATION.uniform_share) / len(orbits) * (shifted - shifted[0])
    return grid, level * elements / level[-1]


def solve_from(
    problem: CycleProblem,
    gait: Gait,
    orbits: tuple[Orbit, ...],
    stage: Stage,
    reach: float,
    mesh: Mesh | None = None,
) -> tuple[Solution, Program, bool]:
    """Solve one program from simulated orbits; also tell whether the reach was binding."""
    mesh = mesh or mesh_for(orbits, stage.elements)
    p = problem.program(mesh.elements)
    z, scales = unknowns_from_orbits(p.layout, list(problem.robots), list(orbits), mesh)
    worth = score(problem, gait, orbits)
    parameters = problem.parameters(p, mesh, scales, stage.friction_speed_m_s, worth.scale)
    z[p.layout.merit] = worth.merit / worth.scale
    unknowns, rows, binding = bounded(problem, p, z, reach)
    options: dict[str, Any] = _QUICK if stage.quick else _PATIENT
    if problem.goal.turn == "side" and not stage.quick:
        options = {**options, "theta_max_fact": COLLOCATION.roaming_factor}
    solution = p.solve(z, parameters, unknowns, rows, options=options, solver=problem.solver)
    return solution, p, binding(solution.z)


def bounded(
    problem: CycleProblem, p: Program, z: np.ndarray, reach: float
) -> tuple[Bounds, Bounds, Callable[[np.ndarray], bool]]:
    """Return bounds of unknowns and rows, the gait kept within reach of `z`, and whether the reach binds."""
    (low, high), rows = problem.bounds(p)
    part = slice(0, 2 + p.layout.switches)
    span = np.full(2 + p.layout.switches, reach)
    span[0], span[1] = CONTINUATION.frequency_reach_hz * reach, CONTINUATION.pressure_reach * reach
    limit_low, limit_high = low[part].copy(), high[part].copy()
    low[part] = np.clip(z[part] - span, limit_low, limit_high)
    high[part] = np.clip(z[part] + span, limit_low, limit_high)
    for r in range(len(problem.robots)):
        states = p.layout.states(r)
        low[states], high[states] = -CONTINUATION.state_limit, CONTINUATION.state_limit

    def binding(found: np.ndarray) -> bool:
        margin = 1e-3 * span
        # a limit of the problem itself is no reason to solve again
        at_low = (found[part] < low[part] + margin) & (low[part] > limit_low + margin)
        at_high = (found[part] > high[part] - margin) & (high[part] < limit_high - margin)
        return bool((at_low | at_high).any())

    return (low, high), rows, binding

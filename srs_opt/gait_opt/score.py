"""How good a simulated gait is for a goal, and by how much it misses what was asked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.guess import switches_of
from srs_opt.gait_opt.collocation.problem import CycleProblem, weight_n
from srs_opt.gait_opt.goal import air_work_j
from srs_opt.gait_opt.objectives.built_in import TRANSPORT
from srs_opt.gait_opt.objectives.cycle import SAMPLES
from srs_opt.gait_opt.objectives.objective import Objective, formulas
from srs_opt.gait_opt.settings import GOAL, SCORE
from srs_opt.orbit.steady import Orbit
from srs_opt.simulate.interpolate import linear


@dataclass(frozen=True)
class Score:
    """Worst robot's weighted merit (as the program has it) and how far the wishes are missed (no unit)."""

    merit: float
    miss: float

    @property
    def total(self) -> float:
        """Merit less a penalty for misses: what gaits are compared by."""
        return self.merit - SCORE.miss_weight * self.miss

    @property
    def scale(self) -> float:
        """What tolerances on the merit are multiplied by: 1, less for a robot that hardly moves."""
        return float(np.clip(abs(self.merit) / SCORE.small_merit, SCORE.least_scale, 1.0))


def score(problem: CycleProblem, gait: Gait, orbits: tuple[Orbit, ...]) -> Score:
    """Return the score of a gait from its simulated orbits, one per robot: worst merit, worst miss."""
    each = robot_scores(problem, gait, orbits)
    return Score(min(s.merit for s in each), max(s.miss for s in each))


def robot_scores(problem: CycleProblem, gait: Gait, orbits: tuple[Orbit, ...]) -> tuple[Score, ...]:
    """Return the score of every robot."""
    found = []
    for r, orbit in enumerate(orbits):
        merit, rows = evaluated(problem, problem.goal.aim, gait, r, orbit)
        own = sum(over for _, over in broken_constraints(problem, rows))
        found.append(
            Score(problem.weight(r) * merit, _miss(problem, r, orbit) + _limits_miss(problem, orbit) + own)
        )
    return tuple(found)


def evaluated(
    problem: CycleProblem, objective: Objective, gait: Gait, robot: int, orbit: Orbit
) -> tuple[float, np.ndarray]:
    """Return merit and constraints of an objective for a simulated gait of one of the robots."""
    limits = problem.limits.for_robot(problem.robots[0])
    air = air_work_j(sum(map(len, gait.intervals)), gait.pressure_kpa, limits.chamber_volume_m3)
    right, left = orbit.envelope_m
    motion = (orbit.speed_m_s, orbit.turn_rate_rad_s, orbit.work_j, air, left, right)
    scalars = np.array([*motion, gait.frequency_hz, gait.pressure_kpa, weight_n(problem.robots[robot])])
    first_s = gait.intervals[0][0][0]
    aim = formulas(objective, gait.segments, len(gait.intervals[0]))
    curvature = np.zeros((gait.segments, SAMPLES))
    if aim.uses_curvature:
        at = (first_s + np.arange(SAMPLES) / SAMPLES * gait.period_s) % gait.period_s
        curvature = linear(orbit.time_s, orbit.kappa, at).T
    return aim(scalars, switches_of(gait, first_s), curvature)


def broken_constraints(problem: CycleProblem, rows: np.ndarray) -> list[tuple[str, float]]:
    """Return name and excess of the objective's own constraints that do not hold."""
    own = problem.formulas
    over = np.maximum(np.maximum(own.low - rows, rows - own.high), 0.0)
    # `not <=`: a constraint that is not a number is broken
    return [(name, float(v)) for name, v in zip(own.names, over) if not v <= 0.0]


def transport_cost(problem: CycleProblem, gait: Gait, robot: int, orbit: Orbit) -> float:
    """Return the cost of transport of a simulated gait."""
    return -evaluated(problem, TRANSPORT, gait, robot, orbit)[0]


def _miss(problem: CycleProblem, robot: int, orbit: Orbit) -> float:
    """Return by how much a robot misses speed and turn, as shares of a typical motion."""
    goal, lever = problem.goal, SCORE.lever * problem.robots[robot].length_m
    turn, floor = orbit.turn_rate_rad_s, goal.floor_m_s
    missed = 0.0
    if goal.turn == "side":
        missed += lever * max(GOAL.least_turn_rad_s - goal.sense * turn, 0.0)
    elif goal.radius_m is not None:
        # compared as turn rates, which stay finite for a straight path
        missed += lever * abs(turn - orbit.speed_m_s / goal.radius_m)
    elif goal.turn != "any":
        missed += lever * abs(turn - (goal.turn_rate_rad_s or 0.0))
    return missed if floor is None else missed + max(1 - orbit.speed_m_s / floor, 0.0)


def _limits_miss(problem: CycleProblem, orbit: Orbit) -> float:
    """Return by how much the swept band and the curvature (1 for all of it) are exceeded."""
    band, most = problem.goal.envelope_m, problem.limits.max_curvature_1_m
    over = 0.0 if band is None else SCORE.band_miss_per_m * max(sum(orbit.envelope_m) - band, 0.0)
    return over if most is None else over + max(float(np.abs(orbit.kappa).max()) / most - 1, 0.0)

"""How good a simulated gait is for a goal, and by how much it misses what was asked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.layout import ENVELOPE_UNIT_M
from srs_opt.gait_opt.collocation.problem import CycleProblem, weight_n
from srs_opt.gait_opt.goal import air_work_j, cost_of_transport
from srs_opt.orbit.steady import Orbit

_PENALTY = 5.0
_LEVER_M = 0.1
_SLOW = 0.1  # merit (m/s, where speed counts) below which tolerances shrink with it
_LEAST_SCALE = 0.01


@dataclass(frozen=True)
class Score:
    """Merit of the worst robot (as the program has it) and how far the wishes are missed (no unit)."""

    merit: float
    miss: float

    @property
    def total(self) -> float:
        """Merit less a penalty for misses: what gaits are compared by."""
        return self.merit - _PENALTY * self.miss

    @property
    def scale(self) -> float:
        """What tolerances on the merit are multiplied by: 1, less for a robot that hardly moves."""
        return float(np.clip(abs(self.merit) / _SLOW, _LEAST_SCALE, 1.0))


def score(problem: CycleProblem, gait: Gait, orbits: tuple[Orbit, ...]) -> Score:
    """Return the score of a gait from its simulated orbits, one per robot."""
    merits = [_merit(problem, gait, k, o) for k, o in enumerate(orbits)]
    return Score(min(merits), max(_miss(problem, orbits[0]), *(_limits_miss(problem, o) for o in orbits)))


def transport_cost(problem: CycleProblem, gait: Gait, robot: int, orbit: Orbit) -> float:
    """Return the cost of transport of a simulated gait."""
    limits = problem.limits.for_robot(problem.robots[0])
    intervals = sum(map(len, gait.intervals))
    air = air_work_j(intervals, gait.pressure_kpa, limits.chamber_volume_m3 or 0.0)
    distance = max(abs(orbit.speed_m_s) * gait.period_s, 1e-9)
    return cost_of_transport(orbit.work_j, air, distance, weight_n(problem.robots[robot]))


def _merit(problem: CycleProblem, gait: Gait, robot: int, orbit: Orbit) -> float:
    goal = problem.goal
    if goal.objective == "transport":
        return -transport_cost(problem, gait, robot, orbit)
    if goal.objective == "slim":
        return -sum(orbit.envelope_m) / ENVELOPE_UNIT_M
    if goal.tightest:
        radius = orbit.radius_m
        return -10 * (1e3 if radius is None else radius)
    return orbit.speed_m_s


def _miss(problem: CycleProblem, orbit: Orbit) -> float:
    """Return by how much the nominal robot misses speed and turn, as shares of a typical motion."""
    goal = problem.goal
    wanted_turn = goal.turn_rate_rad_s
    missed = 0.0
    if goal.radius_m is not None:
        wanted_turn = orbit.speed_m_s / goal.radius_m
    elif wanted_turn is None and not goal.tightest:
        wanted_turn = 0.0
    if wanted_turn is not None:
        missed += _LEVER_M * abs(orbit.turn_rate_rad_s - wanted_turn)
    if goal.speed_m_s and goal.objective != "speed":
        missed += max(goal.speed_m_s - orbit.speed_m_s, 0.0)
    return missed


def _limits_miss(problem: CycleProblem, orbit: Orbit) -> float:
    """Return by how much the swept band (10 for a metre) and the curvature (1 for all of it) are exceeded."""
    band, most = problem.goal.envelope_m, problem.limits.max_curvature_1_m
    over = 0.0 if band is None else 10 * max(sum(orbit.envelope_m) - band, 0.0)
    return over if most is None else over + max(float(np.abs(orbit.kappa).max()) / most - 1, 0.0)

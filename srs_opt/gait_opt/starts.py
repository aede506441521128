"""Where the search begins: the published gait, then quasi-random waves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait, Wave, published_wave
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.continuation import orbits_of
from srs_opt.gait_opt.corrections import steered
from srs_opt.gait_opt.goal import Goal
from srs_opt.gait_opt.score import score
from srs_opt.gait_opt.settings import START
from srs_opt.orbit.steady import steady_gait


def starting_gaits(problem: CycleProblem, count: int, seed: int) -> list[Gait]:
    """Return `count` gaits inside the limits; the first is the published one.

    The others are waves whose lag, its spread, frequency and pressure come from a scrambled Sobol sequence.
    """
    from scipy.stats import qmc

    robot, limits = problem.robots[0], problem.limits
    middle = tuple((a + b) / 2 for a, b in (limits.frequency_hz, limits.pressure_kpa))
    gaits = [published_wave(robot, limits.frequency_hz[1], middle[1]).gait()]
    segments = robot.segments
    sampler = qmc.Sobol(3 + segments, seed=seed)
    wholeturn = 2 * math.pi
    # Sobol sequences are balanced at powers of two
    for u in sampler.random(1 << max(count - 1, 1).bit_length())[: count - 1]:
        ranges = (limits.frequency_hz, limits.pressure_kpa)
        frequency, pressure = (float(a + v * (b - a)) for v, (a, b) in zip(u, ranges))
        # from three quarters of a wave on the body to one and a half
        lag = wholeturn / (segments + 1) * (START.least_waves + START.wave_range * u[2])
        phases = lag * np.arange(1, segments + 1) + START.phase_range_rad * (u[3:] - 0.5)
        gaits.append(Wave(frequency, pressure, tuple(phases.tolist()), (0.0,) * segments).gait())
    return [turned(problem, g) for g in gaits]


def turned(problem: CycleProblem, gait: Gait) -> Gait:
    """Return the gait duty-biased towards the wanted turn, as far as smoothed friction lets it."""
    goal = problem.goal
    robot = replace(problem.robots[0], friction_speed_m_s=START.friction_speed_m_s)
    if goal.turn == "side":
        turn = goal.sense * START.steered_rad_s
        if goal.sense * steady_gait(robot, gait, problem.model).turn_rate_rad_s >= START.steered_rad_s:
            return gait
        return steered(
            gait,
            lambda g: steady_gait(robot, g, problem.model).turn_rate_rad_s - turn,
            START.rough_turn_rad_s,
        )
    if goal.radius_m is None and not goal.turn_rate_rad_s:
        return gait
    try:
        return steered(gait, turn_miss(problem, START.friction_speed_m_s), START.smoothed_turn_rad_s)
    except NoAnswerError:
        return gait


def best_start(problem: CycleProblem, gaits: Sequence[Gait]) -> Gait:
    """Return the best, simulated, of some gaits duty-biased towards the wanted turn.

    Raises
    ------
    NoAnswerError
        If none of them has a steady state.
    """
    found: list[tuple[float, int, Gait]] = []
    for k, start in enumerate(gaits):
        with suppress(NoAnswerError):
            if problem.goal.radius_m is not None:
                start = steered(start, turn_miss(problem), START.turn_tolerance_rad_s)
            # -k: of equal scores the first start wins, and gaits are never compared
            found.append((score(problem, start, orbits_of(problem, start)).total, -k, start))
    if not found:
        raise NoAnswerError("no starting gait reaches a steady motion")
    return max(found)[-1]


def plain_waves(problem: CycleProblem) -> list[Gait]:
    """Return uniform waves from slim to strong.

    A neighbour's optimum can lead into a corner of the rugged landscape that a plain wave does not know.
    """
    robot, limits = problem.robots[0], problem.limits
    least, most = limits.pressure_kpa
    pressures = [share * most for share in START.pressure_shares if share * most >= least]
    lags = [waves * 2 * math.pi / robot.links for waves in START.waves_on_body]
    return [
        Wave.uniform(robot.segments, limits.frequency_hz[1], pressure, lag).gait()
        for pressure in pressures
        for lag in lags
    ]


def turn_miss(problem: CycleProblem, friction_speed_m_s: float = 0.0) -> Callable[[Gait], float]:
    """Return a function that tells by how much a gait turns further left than wanted, rad/s."""
    goal: Goal = problem.goal
    own = problem.robots[0].friction_speed_m_s
    robot = replace(problem.robots[0], friction_speed_m_s=max(own, friction_speed_m_s))

    def miss(gait: Gait) -> float:
        orbit = steady_gait(robot, gait, problem.model)
        wanted = goal.turn_rate_rad_s or 0.0
        if goal.radius_m is not None:
            wanted = orbit.speed_m_s / goal.radius_m
        return orbit.turn_rate_rad_s - wanted

    return miss

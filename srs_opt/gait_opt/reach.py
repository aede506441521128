"""Limits that no gait can keep, found from the closed-form curvature before any search."""

from __future__ import annotations

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait_opt.collocation.guess import parameter_numbers
from srs_opt.gait_opt.collocation.point import PointKind, linear_shape
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.settings import FEASIBILITY
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.robot import Robot

_SHARES = np.linspace(0.3, 0.7, 41)  # of the time that a valve is on


def refuse_contradictions(problem: CycleProblem) -> None:
    """Refuse a curvature limit below what every gait within the other limits reaches.

    Raises
    ------
    NoAnswerError
        With the least curvature that can be reached.
    """
    most = problem.limits.max_curvature_1_m
    if most is None:
        return
    for robot in problem.robots:
        least = least_curvature_1_m(problem, robot)
        if least is not None and most * (1 + FEASIBILITY.excess) < least:
            frequency, pressure = problem.limits.frequency_hz[1], problem.limits.pressure_kpa[0]
            who = f" of robot '{robot.name}'" if len(problem.robots) > 1 else ""
            raise NoAnswerError(
                f"no gait within these limits keeps curvatures{who} below {most:g} 1/m: the least that can "
                f"be reached is {least:.2f} 1/m, at {pressure:g} kPa and {frequency:g} Hz; raise "
                "--max-curvature, lower the least --pressure or raise the highest --frequency"
            )


def least_curvature_1_m(problem: CycleProblem, robot: Robot) -> float | None:
    """Return the smallest largest curvature over a cycle that evenly spread on-intervals reach.

    None where curvatures have no closed form (soft bodies, effects that make the actuators nonlinear).
    """
    kind = PointKind(Structure.of(robot, problem.model, room=False), problem.intervals)
    if kind.structure.compliant or not build(kind.structure)[2].linear:
        return None
    shape = linear_shape(kind, FEASIBILITY.instants)
    at = np.arange(FEASIBILITY.instants)[None] / FEASIBILITY.instants
    numbers = parameter_numbers(robot, kind)
    k = problem.intervals
    (slow, fast), pressures = problem.limits.frequency_hz, problem.limits.pressure_kpa
    # evenly spread pulses: the actuator smooths them most
    starts = np.arange(k) / k
    best = np.full(kind.segments, np.inf)
    for share in _SHARES:
        switches = np.tile(np.concatenate([starts, starts + share / k]), kind.segments)
        for frequency in {slow, fast}:
            for pressure in set(pressures):
                kappa = np.asarray(
                    shape(switches, frequency, pressure, at, numbers, FEASIBILITY.switch_half_width)[0]
                )
                best = np.minimum(best, np.abs(kappa).max(axis=1))
    return float(best.max())

"""Gaits for bodies of unknown stiffness: several robots in one problem, each beside its published gait."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from srs_opt.errors import NoAnswerError
from srs_opt.gait import published_wave
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.settings import STIFFNESS
from srs_opt.orbit.steady import Orbit, steady_gait
from srs_opt.robot import Robot


def of_stiffness(robot: Robot, ei_n_m2: float) -> Robot:
    """Return the robot with another bending stiffness, which its name says."""
    return robot.with_values(bending_stiffness_n_m2=ei_n_m2, name=f"{robot.name}, EI {ei_n_m2:g} N m^2")


def stiffness_key(robot: Robot) -> str:
    """Return the name of the stiffness that makes a soft robot soft: the segments', else the gaps'."""
    return "gap_stiffness_n_m2" if robot.bending_stiffness_n_m2 is None else "bending_stiffness_n_m2"


def stiffness_deviation(robot: Robot) -> float:
    """Return the relative standard deviation of a soft robot's stiffness; 0 if rigid or not given."""
    return robot.relative_sd.get(stiffness_key(robot), 0.0) if robot.is_soft else 0.0


def stiffness_interval(robot: Robot) -> tuple[Robot, ...]:
    """Return the robot with its own stiffness and with those at the ends of what it may be.

    These are two standard deviations of its logarithm away (`Robot.relative_sd`); the robot alone where the
    file has no deviation, or one below `STIFFNESS.least_sd`.
    """
    key, sd = stiffness_key(robot), stiffness_deviation(robot)
    if sd < STIFFNESS.least_sd:
        return (robot,)
    # a factor, as the deviation is one of the logarithm: a stiffness stays positive
    reach, ei = math.exp(STIFFNESS.interval_sd * sd), getattr(robot, key)
    what = "gap EI" if key == "gap_stiffness_n_m2" else "EI"
    return robot, *(
        robot.with_values(**{key: value, "name": f"{robot.name}, {what} {value:g} N m^2"})
        for value in (ei / reach, ei * reach)
    )


SPREAD = {
    "curvature per pressure": ("curvature_per_pressure_1_m_kpa",),
    "time constants": ("tau1_s", "tau2_s"),
}


def spread(robots: Sequence[Robot], share: float) -> list[Robot]:
    """Return the robots, then the softest and the stiffest with other actuators.

    Curvature per pressure and both time constants are `share` below and above; a robust gait for stiffnesses
    alone loses most where these are off on a body at an end of the range.
    """
    order = sorted(robots, key=lambda robot: robot.bending_stiffness_n_m2 or math.inf)
    found = list(robots)
    for robot in order[:: len(order) - 1] if len(order) > 1 else order:
        for what, names in SPREAD.items():
            for factor in (1 - share, 1 + share):
                values = {name: factor * getattr(robot, name) for name in names}
                found.append(robot.with_values(name=f"{robot.name}, {what} x {factor:g}", **values))
    return found


def in_the_middle(robots: Sequence[Robot]) -> tuple[Robot, ...]:
    """Return robots that differ in stiffness, the middle one first, its deviation covering the others."""
    order = sorted(robots, key=lambda robot: robot.bending_stiffness_n_m2 or math.inf)
    nominal = order.pop(len(order) // 2)
    stiffnesses = [robot.bending_stiffness_n_m2 or math.inf for robot in robots]
    reach = max(abs(math.log(ei / (nominal.bending_stiffness_n_m2 or math.inf))) for ei in stiffnesses)
    deviations = {**nominal.relative_sd, "bending_stiffness_n_m2": reach / STIFFNESS.interval_sd}
    return nominal.with_values(relative_sd=deviations), *order


def published_orbit(problem: CycleProblem, robot: Robot) -> Orbit:
    """Return the published gait's motion at the upper limits of frequency and pressure."""
    limits = problem.limits
    gait = published_wave(robot, limits.frequency_hz[1], limits.pressure_kpa[1]).gait()
    return steady_gait(robot, gait, problem.model)


def relative(problem: CycleProblem) -> CycleProblem:
    """Return the problem in which a robot's merit counts relative to its published gait's speed.

    The nominal robot's merit stays as it is.

    Raises
    ------
    NoAnswerError
        If the published gait hardly moves one of them.
    """
    speeds = []
    for robot in problem.robots:
        speeds.append(published_orbit(problem, robot).speed_m_s)
        if speeds[-1] < STIFFNESS.least_published_m_s:
            raise NoAnswerError(
                f"the published gait makes {speeds[-1]:.4f} m/s on robot '{robot.name}', nothing to compare "
                "with: use --worst absolute"
            )
    # the nominal robot's weight is 1, so that merits keep their unit
    return replace(problem, weights=tuple(speeds[0] / speed for speed in speeds))

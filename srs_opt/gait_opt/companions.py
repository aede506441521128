"""A straight gait with its turning companions: the smallest table with which a robot finds its way."""

from __future__ import annotations

import math
from collections.abc import Callable

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait, Wave
from srs_opt.gait_opt.corrections import duty_biased, end_for_end, in_step
from srs_opt.gait_opt.table import GaitTable, TableGait
from srs_opt.gait_opt.table_settings import COMPANION
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import Robot

TICK_S = 0.001


def duty_biased_family(robot: Robot, gait: Gait, model: str = "complex") -> GaitTable:
    """Return a straight gait duty-biased to either side, forward and backward, in the controller's ticks.

    Parameters
    ----------
    robot : Robot
    gait : Gait
        Straight.
    model : {"complex", "simplified"}
    """
    # an offset makes a wave's on-intervals longer by asin(offset)/pi of the cycle
    return _family(robot, lambda offset: duty_biased(gait, math.asin(offset) / math.pi), model)


def wave_family(
    robot: Robot, frequency_hz: float, pressure_kpa: float, lag_rad: float, model: str = "complex"
) -> GaitTable:
    """Return the family of a uniform wave, its offset to either side, forward and backward."""

    def leaning(offset: float) -> Gait:
        return Wave.uniform(robot.segments, frequency_hz, pressure_kpa, lag_rad, offset).gait()

    return _family(robot, leaning, model)


def _family(robot: Robot, leaning: Callable[[float], Gait], model: str) -> GaitTable:
    entries = []
    for name, gait in _gaits(leaning, TICK_S):
        try:
            orbit = steady_gait(robot, gait, model)
        except NoAnswerError:
            continue
        entry = TableGait.of_orbit(name, orbit)
        if abs(entry.speed_m_s) > COMPANION.slowest_m_s:
            entries.append(entry)
    return GaitTable(robot.name, robot.fingerprint(), model, tuple(entries))


def duty_biased_gaits(gait: Gait, tick_s: float) -> list[tuple[str, Gait]]:
    """Return a straight gait duty-biased to either side, forward and backward, by name."""
    return _gaits(lambda offset: duty_biased(gait, math.asin(offset) / math.pi), tick_s)


def _gaits(leaning: Callable[[float], Gait], tick_s: float) -> list[tuple[str, Gait]]:
    return [
        (f"{offset:+g}{way}", in_step(turned(leaning(offset)), tick_s))
        for offset in [sign * size for size in COMPANION.offsets for sign in ((1, -1) if size else (1,))]
        for way, turned in (("", _unchanged), (" back", end_for_end))
    ]


def _unchanged(gait: Gait) -> Gait:
    return gait

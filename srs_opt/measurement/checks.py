"""Readings of other instruments against what the documented robot implies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from srs_opt.measurement.records import Check
from srs_opt.robot import Robot


@dataclass(frozen=True)
class CheckResult:
    """A reading, what was expected, and the gap in standard deviations (None when nothing is expected)."""

    quantity: str
    value: float
    sd: float
    expected: float | None
    deviations: float | None


def expected_value(quantity: str, robot: Robot) -> float | None:
    """Return what `quantity` reads on the robot as documented, None for an unknown quantity.

    Known: tail_load_n and head_load_n (scale under the first or last wheel pair), ruler_scale and
    ruler_scale_at_1m (measured over true length), valve_light_delay_s, floor_angle_rad,
    bending_flexibility_1_n_m2 (1/EI of a segment: chamber and gap in series).
    """
    load = robot.link_mass_kg * robot.gravity_m_s2
    return {
        "tail_load_n": load,
        "head_load_n": load,
        "ruler_scale": 1.0,
        "ruler_scale_at_1m": 1.0,
        "valve_light_delay_s": robot.valve_delay_s,
        "floor_angle_rad": 0.0,
        "bending_flexibility_1_n_m2": _flexibility(robot),
    }.get(quantity)


def _flexibility(robot: Robot) -> float:
    chamber = 1 / robot.bending_stiffness_n_m2 if robot.bending_stiffness_n_m2 else 0.0
    gap = robot.gap_length_m / robot.segment_length_m
    return chamber + (gap / robot.gap_stiffness_n_m2 if robot.gap_stiffness_n_m2 else 0.0)


def compare_checks(checks: Sequence[Check], robot: Robot) -> tuple[CheckResult, ...]:
    """Compare each reading with what the documented robot implies."""
    results = []
    for check in checks:
        expected = expected_value(check.quantity, robot)
        gap = None if expected is None or check.sd <= 0 else (check.value - expected) / check.sd
        results.append(CheckResult(check.quantity, check.value, check.sd, expected, gap))
    return tuple(results)

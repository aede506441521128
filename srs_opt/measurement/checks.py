"""Readings of other instruments against what the documented robot implies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from srs_opt.measurement.instruments import INSTRUMENTS
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


def compare_checks(checks: Sequence[Check], robot: Robot) -> tuple[CheckResult, ...]:
    """Compare each reading with what the documented robot implies."""
    known, results = INSTRUMENTS.all(), []
    for check in checks:
        instrument = known.get(check.quantity)
        expected = None if instrument is None else instrument.documented(robot)
        gap = None if expected is None or check.sd <= 0 else (check.value - expected) / check.sd
        results.append(CheckResult(check.quantity, check.value, check.sd, expected, gap))
    return tuple(results)

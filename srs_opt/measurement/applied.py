"""Reads and writes drives/<trial>.csv: what the chambers were given over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from srs_opt.measurement.records import Applied
from srs_opt.problem import Report
from srs_opt.robot import Robot
from srs_opt.table import read_numbers

FOLDER = "drives"


def applied_columns(segments: int) -> tuple[str, ...]:
    """Return the columns of a drive given in pressures."""
    return ("time_s", *(f"{side}{k}_kpa" for k in range(1, segments + 1) for side in ("left", "right")))


def state_columns(segments: int) -> tuple[str, ...]:
    """Return the columns of a drive given in valve states; the pressure is then the trial's."""
    return ("time_s", *(f"s{k}" for k in range(1, segments + 1)))


def read_applied(
    folder: Path, trial: str, robot: Robot, pressure_kpa: float, report: Report
) -> Applied | None:
    """Read a trial's drive; None where it has none, or (and a report) where nothing can be made of it."""
    file = f"{FOLDER}/{trial}.csv"
    if not (folder / file).is_file():
        return None
    table = read_numbers(file, report)
    if table is None:
        return None
    pressures, states = applied_columns(robot.segments), state_columns(robot.segments)
    if table.header not in (pressures, states):
        wanted = f"{', '.join(pressures[:3])} ... or {', '.join(states[:2])} ..."
        report.error(file, 1, f"expected the columns {wanted} up to segment {robot.segments}")
        return None
    time_s, rest = table.values[:, 0], table.values[:, 1:]
    if np.isnan(table.values).any() or time_s[0] != 0 or np.any(np.diff(time_s) <= 0):
        report.error(file, 2, "expected numbers without gaps, times that ascend from 0")
        return None
    if table.header == states:
        if np.abs(rest).max() > 1:
            report.error(file, 2, "valve states must lie between -1 (right) and 1 (left)")
            return None
        return Applied(time_s, rest, np.full(len(time_s), pressure_kpa))
    if rest.min() < 0:
        report.error(file, 2, "pressures must not be negative")
        return None
    left, right = rest[:, 0::2], rest[:, 1::2]
    supply = np.maximum(left, right).max(axis=1)
    # S is the difference of the antagonistic chambers over the supply; nothing where nothing is supplied
    share = np.divide(left - right, supply[:, None], out=np.zeros_like(left), where=supply[:, None] > 0)
    return Applied(time_s, share, supply)


def applied_text(applied: Applied) -> str:
    """Return a drive as its file holds it, in pressures."""
    segments = applied.state.shape[1]
    rows = [",".join(applied_columns(segments))]
    for time_s, state, pressure in zip(applied.time_s, applied.state, applied.pressure_kpa):
        sides = [f"{max(s, 0.0) * pressure:.6g},{max(-s, 0.0) * pressure:.6g}" for s in state]
        rows.append(",".join([f"{time_s:.6f}", *sides]))
    return "\n".join(rows) + "\n"

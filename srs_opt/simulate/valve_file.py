"""Valves over time as a CSV file: what the player plays once, and what `srs_opt.simulate` replays."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import IO

import numpy as np

from srs_opt.errors import InputError
from srs_opt.files import write_with
from srs_opt.simulate.timeline import Timeline
from srs_opt.table import first_error, read_table


def valve_columns(segments: int) -> list[str]:
    """Return the file's columns."""
    return ["duration_s", "pressure_kpa", *(f"valve{i + 1}" for i in range(segments))]


def write_valves(timeline: Timeline, path: Path) -> Path:
    """Write one line per phase of held valves: +1 bends left, -1 right, 0 vents."""

    def fill(stream: IO[str]) -> None:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(valve_columns(timeline.valve.shape[0]))
        for duration, pressure, valve in zip(timeline.duration_s, timeline.pressure_kpa, timeline.valve.T):
            writer.writerow([f"{duration:.9g}", f"{pressure:.9g}", *(int(v) for v in valve)])

    return write_with(path, fill)


def read_valves(path: str, segments: int) -> Timeline:
    """Read a file that `write_valves` wrote.

    Raises
    ------
    InputError
        For another number of segments, durations that are not above 0, or valves other than -1, 0, 1.
    """
    columns = valve_columns(segments)
    rows, report = read_table(path, columns)
    table = np.array([[row.number(name, report) for name in columns] for row in rows], dtype=float)
    first_error(report)
    if not len(rows):
        raise InputError(f"{path}: holds no phases")
    for row, values in zip(rows, table):
        if not (values[0] > 0 and values[1] >= 0 and math.isfinite(values[:2].sum())):
            raise InputError(f"{path}, line {row.line}: expected duration_s above 0 and pressure_kpa from 0")
        if not np.isin(values[2:], (-1, 0, 1)).all():
            raise InputError(f"{path}, line {row.line}: valves are -1, 0 or 1")
    return Timeline(table[:, 0], table[:, 2:].T.copy(), table[:, 1], np.ones(len(table)))

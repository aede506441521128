"""Gait tables as CSV. For controllers see `srs_opt.controller`."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import IO

from srs_opt.files import write_with
from srs_opt.gait_opt.table import GaitTable

COLUMNS = (
    "name",
    "speed_m_s",
    "turn_rate_rad_s",
    "radius_m",
    "envelope_right_m",
    "envelope_left_m",
    "frequency_hz",
    "pressure_kpa",
    "dx_m",
    "dy_m",
    "turn_rad",
    "friction_work_j",
    "segment",
    "on_s",
    "off_s",
)


def write_csv(table: GaitTable, path: Path) -> Path:
    """Write one row per on-interval (a gait's motion is repeated in each of its rows)."""

    def rows(stream: IO[str]) -> None:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        for g in table.gaits:
            motion = [g.name, g.speed_m_s, g.turn_rate_rad_s, "" if g.radius_m is None else g.radius_m]
            motion += [
                *g.envelope_m,
                g.gait.frequency_hz,
                g.gait.pressure_kpa,
                *g.displacement,
                g.friction_work_j,
            ]
            for segment, pairs in enumerate(g.gait.intervals, start=1):
                for on, off in pairs:
                    writer.writerow([*motion, segment, on, off])

    return write_with(path, rows)

"""Gait tables for others: CSV for people, a C header for controllers."""

from __future__ import annotations

import csv
import re
from importlib import resources
from pathlib import Path
from typing import IO

from srs_opt.files import write_text, write_with
from srs_opt.gait_opt.table import GaitTable
from srs_opt.gait_opt.ticks import WORD_BITS, Schedule

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


def c_header(table: GaitTable, tick_s: float) -> str:
    """Return a C99 header: schedules in ticks, valve masks, lookup by (speed, turn rate)."""
    segments = table.gaits[0].gait.segments
    words = -(-2 * segments // WORD_BITS)
    schedules = [Schedule.of_gait(g.gait, tick_s) for g in table.gaits]
    events: list[str] = []
    starts: list[int] = []
    for schedule in schedules:
        starts.append(len(events))
        events += [
            f"  {{{tick}u, {{{', '.join(f'0x{w:08x}u' for w in _split(mask, words))}}}}}"
            for tick, mask in schedule.events
        ]
    gaits = [
        f'  {{"{_name(g.name)}", {s.period}u, {start}u, {len(s.events)}u, {g.gait.pressure_kpa * 1e3:.0f}, '
        f"{g.speed_m_s * 1e3:.0f}, {g.turn_rate_rad_s * 1e3:.0f}}}"
        for g, s, start in zip(table.gaits, schedules, starts)
    ]
    template = resources.files("srs_opt.gait_opt").joinpath("gait_table.h.in").read_text(encoding="utf-8")
    values = {
        "ROBOT": _name(table.robot_name),
        "FINGERPRINT": table.fingerprint,
        "TICK_US": f"{tick_s * 1e6:.0f}",
        "SEGMENTS": str(segments),
        "WORDS": str(words),
        "COUNT": str(len(gaits)),
        "EVENT_COUNT": str(len(events)),
        "EVENTS": ",\n".join(events),
        "GAITS": ",\n".join(gaits),
    }
    return re.sub(r"@(\w+)@", lambda found: values[found[1]], template)


def write_header(table: GaitTable, path: Path, tick_s: float) -> Path:
    """Write the C header."""
    return write_text(path, c_header(table, tick_s))


def _split(mask: int, words: int) -> list[int]:
    return [(mask >> (WORD_BITS * k)) & (2**WORD_BITS - 1) for k in range(words)]


def _name(text: str) -> str:
    return re.sub(r'[^ -~]|["\\]', "_", text)

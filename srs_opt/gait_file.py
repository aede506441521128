"""Gaits in files: the JSON of gait_opt, a gait of a table, or a schedule of switch times."""

from __future__ import annotations

import math
from collections import defaultdict
from pathlib import Path

from srs_opt.document import Document, parse_yaml, unknown_word
from srs_opt.errors import InputError
from srs_opt.files import read_text
from srs_opt.gait import Gait
from srs_opt.table import first_error, read_table

SCHEDULE_COLUMNS = ("segment", "on_s", "off_s", "period_s")


def load_gait(path: str, pressure_kpa: float) -> Gait:
    """Read a gait from a file.

    Parameters
    ----------
    path : str
        ``gait.json`` as gait_opt writes it; a gait table, ``gait_table.json:NAME`` choosing the gait
        (default: its first); or a schedule ``.csv`` with columns segment, on_s, off_s, period_s.
    pressure_kpa : float
        Pressure for a schedule, which holds none.

    Raises
    ------
    InputError
        If the file is none of these.
    """
    file, _, name = path.rpartition(":") if not Path(path).exists() and ":" in path else (path, "", "")
    text = read_text(file, "a gait (JSON of gait_opt, a gait table, or a schedule CSV)")
    if file.lower().endswith(".csv"):
        return _from_schedule(file, pressure_kpa)
    document = parse_yaml(text, file, "a gait (JSON)")
    record = document.value
    if not isinstance(record, dict):
        found = "is empty" if record is None else "is no gait"
        raise InputError(
            f"{file}: {found} (expected a mapping with keys frequency_hz, pressure_kpa, switches)"
        )
    if "gaits" in record:
        return _from_table(file, name)
    return _from_result(document)


def _from_table(file: str, name: str) -> Gait:
    from srs_opt.gait_opt.table import load_table

    table = load_table(file)
    if not name:
        return table.gaits[0].gait
    names = [g.name for g in table.gaits]
    if name not in names:
        raise InputError(f"{file}: {unknown_word('gait', name, names)}")
    return table[name].gait


def _from_result(document: Document) -> Gait:
    record = document.value
    for key in ("frequency_hz", "pressure_kpa", "switches"):
        if key not in record:
            raise document.error((), f"key '{key}' is missing (expected the JSON that gait_opt writes)")
    pairs: dict[int, list[tuple[float, float]]] = defaultdict(list)
    try:
        for entry in record["switches"]:
            pairs[int(entry["segment"])].append((float(entry["on_s"]), float(entry["off_s"])))
        period, pressure = 1 / float(record["frequency_hz"]), float(record["pressure_kpa"])
    except (TypeError, KeyError, ValueError, ZeroDivisionError) as error:
        raise document.error(
            ("switches",), "expected entries {segment, on_s, off_s} and a frequency"
        ) from error
    return _assemble(pairs, period, pressure, document.source)


def _from_schedule(file: str, pressure_kpa: float) -> Gait:
    pairs: dict[int, list[tuple[float, float]]] = defaultdict(list)
    rows, report = read_table(file, SCHEDULE_COLUMNS)
    periods = set()
    for row in rows:
        segment, on, off, period = (row.number(name, report) for name in SCHEDULE_COLUMNS)
        if math.isfinite(segment):
            pairs[int(segment)].append((on, off))
        periods.add(period)
    first_error(report)
    if len(periods) != 1:
        raise InputError(f"{file}: expected one period_s for the whole schedule, found {len(periods)}")
    return _assemble(pairs, periods.pop(), pressure_kpa, file)


def _assemble(pairs: dict[int, list[tuple[float, float]]], period: float, pressure: float, file: str) -> Gait:
    if sorted(pairs) != list(range(1, len(pairs) + 1)):
        raise InputError(
            f"{file}: segments must be numbered 1 (tail) to N-1 without gaps, found {sorted(pairs)}"
        )
    try:
        return Gait(period, pressure, tuple(tuple(pairs[i]) for i in sorted(pairs)))
    except InputError as error:
        raise InputError(f"{file}: {error}") from error

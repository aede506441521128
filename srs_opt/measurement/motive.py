"""OptiTrack Motive's CSV export (format 1.2x): header rows, then Frame, Time and columns per marker."""

from __future__ import annotations

import csv
import io
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from srs_opt.errors import InputError
from srs_opt.files import read_text
from srs_opt.measurement.records import Array

METRES = {"meters": 1.0, "metres": 1.0, "millimeters": 1e-3, "millimetres": 1e-3, "centimeters": 1e-2}
MARKER_TYPES = ("marker", "rigid body marker", "bone marker")
BODY_TYPES = ("rigid body", "bone")
AXES = ("X", "Y", "Z")


@dataclass(frozen=True, eq=False)
class Take:
    """A take as Motive exported it.

    Attributes
    ----------
    source : Path
    name : str
        Take name from the header (the file's name when it has none).
    rate_hz : float
    time_s : ndarray, shape (T,)
    markers, bodies : tuple of str
        Labels of the loose and rigid-body markers, and of the rigid bodies.
    marker_positions_m, body_positions_m : ndarray, shape (T, P, 3)
        Motive's axes, metres; NaN where nothing was seen.
    """

    source: Path
    name: str
    rate_hz: float
    time_s: Array
    markers: tuple[str, ...]
    marker_positions_m: Array
    bodies: tuple[str, ...]
    body_positions_m: Array


@dataclass(frozen=True)
class _Column:
    """One point's three columns."""

    type: str
    name: str
    columns: tuple[int, int, int]


def read_take(path: Path | str) -> Take:
    """Read a Motive CSV export.

    Raises
    ------
    InputError
        If the file is not such an export; the message names the line.
    """
    path = Path(path)
    rows = _rows(path)
    facts = _facts(rows[0][1]) if rows else {}
    if "format version" not in facts:
        raise InputError(f"{path}:1: not a Motive CSV export (expected 'Format Version' in the first line)")
    unit = facts.get("length units", "meters").lower()
    if unit not in METRES:
        raise InputError(f"{path}:1: unknown length units '{unit[:40]}' (expected {', '.join(METRES)})")
    place = next((i for i, (_, cells) in enumerate(rows) if cells[0].strip().lower() == "frame"), None)
    if place is None:
        raise InputError(f"{path}: there is no line that starts with 'Frame'")
    if place + 1 >= len(rows):
        raise InputError(f"{path}:{rows[place][0]}: no frames follow the header")
    found = _columns(path, [cells for _, cells in rows[1 : place + 1]], rows[place][0])
    values = _values(path, rows[place + 1 :], len(rows[place][1])) * 1.0
    time = values[:, 1]
    if not np.isfinite(time).all() or (len(time) > 1 and not (np.diff(time) > 0).all()):
        bad = int(np.argmin(np.r_[True, np.diff(np.nan_to_num(time, nan=-1.0)) > 0]))
        raise InputError(f"{path}:{rows[place + 1 + bad][0]}: time does not increase")
    scale = METRES[unit]
    markers, bodies = (
        _unique([c for c in found if c.type in MARKER_TYPES]),
        _unique([c for c in found if c.type in BODY_TYPES]),
    )
    return Take(
        source=path,
        name=facts.get("take name") or path.stem,
        rate_hz=_rate(path, facts, time),
        time_s=time - time[0],
        markers=tuple(c.name for c in markers),
        marker_positions_m=_positions(values, markers) * scale,
        bodies=tuple(c.name for c in bodies),
        body_positions_m=_positions(values, bodies) * scale,
    )


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    text = read_text(path, "a Motive CSV export")
    reader = csv.reader(io.StringIO(text, newline=""))
    try:
        return [(reader.line_num, cells) for cells in reader if any(cell.strip() for cell in cells)]
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num}: not a CSV table: {error}") from error


def _facts(cells: list[str]) -> dict[str, str]:
    """Return the first line's ``key, value, key, value`` pairs."""
    return {k.strip().lower(): v.strip() for k, v in zip(cells[::2], cells[1::2])}


def _rate(path: Path, facts: dict[str, str], time: Array) -> float:
    for key in ("export frame rate", "capture frame rate"):
        try:
            rate = float(facts.get(key, ""))
        except ValueError:
            continue
        if math.isfinite(rate) and rate > 0:
            return rate
    if len(time) < 2:
        raise InputError(f"{path}: neither the header nor the frames tell the frame rate")
    return float(1 / np.median(np.diff(time)))


def _columns(path: Path, header: list[list[str]], line: int) -> list[_Column]:
    """Group the columns by point: rows named Type and Name, a row with Position, and the row of axes."""
    axes = header[-1]
    named = {cells[1].strip().lower(): cells for cells in header[:-1] if len(cells) > 1 and cells[1].strip()}
    kind = next((c for c in header[:-1] if any(v.strip().lower() == "position" for v in c)), None)
    missing = [word for word in ("type", "name") if word not in named]
    if missing or kind is None:
        word = f"'{missing[0].title()}'" if missing else "'Position'"
        raise InputError(f"{path}:{line}: the header has no row {word} above this line")

    def cell(row: list[str], column: int) -> str:
        return row[column].strip() if column < len(row) else ""

    found = []
    for column in range(2, len(axes) - 2):
        triple = tuple(cell(axes, column + i).upper() for i in range(3))
        places = {cell(kind, column + i).lower() for i in range(3)}
        if triple == AXES and places == {"position"}:
            words = cell(named["type"], column).lower(), cell(named["name"], column)
            found.append(_Column(*words, (column, column + 1, column + 2)))
    if not found:
        raise InputError(f"{path}:{line}: no column holds positions X, Y, Z")
    return found


def _values(path: Path, rows: list[tuple[int, list[str]]], width: int) -> Array:
    values = np.full((len(rows), width), np.nan)
    for i, (line, cells) in enumerate(rows):
        if len(cells) > width and any(c.strip() for c in cells[width:]):
            raise InputError(f"{path}:{line}: {len(cells)} cells where the header has {width} columns")
        try:
            numbers = [float(c) if c.strip() else math.nan for c in cells[:width]]
        except ValueError:
            bad = next(c for c in cells[:width] if c.strip() and not _is_number(c))
            raise InputError(
                f"{path}:{line}: expected a number or an empty cell, found '{bad[:40]}'"
            ) from None
        values[i, : len(numbers)] = numbers
    values[np.isinf(values)] = np.nan
    return values


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _unique(columns: list[_Column]) -> list[_Column]:
    """Keep one column per name: what the cameras saw (Marker) rather than a rigid body's model of it."""
    best: dict[str, _Column] = {}
    for column in columns:
        if column.name not in best or column.type == "marker":
            best[column.name] = column
    return list(best.values())


def _positions(values: Array, columns: list[_Column]) -> Array:
    if not columns:
        return np.empty((len(values), 0, 3))
    points = np.stack([values[:, list(c.columns)] for c in columns], axis=1)
    points[np.isnan(points).any(axis=2)] = np.nan
    return points

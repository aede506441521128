"""OptiTrack Motive's CSV exports: columns per marker (1.2x), or the markers seen, row by row (1.1)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.records import Array
from srs_opt.measurement.takes.sheet import Sheet, parse, printable, read_sheet
from srs_opt.measurement.takes.take import Frames, ReadSettings, Take, take_of, unit_scale

MARKER_TYPES = ("marker", "rigid body marker", "bone marker")
BODY_TYPES = ("rigid body", "bone")
AXES = ("X", "Y", "Z")
# keys of the first line; notes may hold commas, so a value reaches to the next known key
FACTS = (
    "format version",
    "take name",
    "take notes",
    "capture frame rate",
    "export frame rate",
    "capture start time",
    "capture start frame",
    "total frames in take",
    "total exported frames",
    "rotation type",
    "length units",
    "coordinate space",
)


@dataclass(frozen=True)
class _Column:
    """One point's three columns."""

    type: str
    name: str
    columns: tuple[int, int, int]


def is_motive(head: str) -> bool:
    """Whether a file begins as Motive's exports do."""
    line = head.lstrip("\ufeff").lstrip().lower()
    return line.startswith(('"format version"', "format version")) or "optitrack export data" in line[:200]


def read_motive(path: Path, settings: ReadSettings) -> Take:
    """Read a Motive CSV export of either form.

    Raises
    ------
    InputError
        If the file is not such an export; the message names the line.
    """
    sheet = read_sheet(path)
    first = [cell.lower() for cell in sheet.rows[0][1]]
    if first[0] == "comment":
        return _read_rows(sheet, settings)
    if first[0] != "format version":
        raise InputError(f"{path}:1: not a Motive CSV export (expected 'Format Version' in the first line)")
    return _read_columns(sheet, settings)


def _read_columns(sheet: Sheet, settings: ReadSettings) -> Take:
    path, told = sheet.path, list(sheet.told)
    facts = _facts(sheet.rows[0][1])
    scale = settings.scale_m
    if scale is None and "length units" in facts:
        scale = unit_scale(path, 1, facts["length units"])
    header = next((i for i, (_, cells) in enumerate(sheet.rows) if cells[0].lower() == "frame"), None)
    if header is None:
        raise InputError(f"{path}: there is no line that starts with 'Frame'")
    line, axes = sheet.rows[header]
    if header + 1 >= len(sheet.rows):
        raise InputError(f"{path}:{line}: no frames follow the header")
    found = _columns(path, [cells for _, cells in sheet.rows[1 : header + 1]], line)
    for number, cells in sheet.rows[header + 1 :]:
        if len(cells) > len(axes) and any(cells[len(axes) :]):
            raise InputError(f"{path}:{number}: {len(cells)} cells where the header has {len(axes)} columns")
    clock = next(
        (i for i, c in enumerate(axes) if c.lower().startswith("time") and "code" not in c.lower()), 1
    )
    values = sheet.numbers(header + 1, [0, clock])
    lines = [number for number, _ in sheet.rows[header + 1 :]]
    markers = _unique([c for c in found if c.type in MARKER_TYPES])
    bodies = _unique([c for c in found if c.type in BODY_TYPES])
    return take_of(
        path,
        Frames(values[:, 1], values[:, 0], lines),
        _rate(facts, sheet.decimal),
        [c.name for c in markers],
        _positions(sheet, header + 1, markers),
        told,
        scale_m=scale,
        name=facts.get("take name", ""),
        bodies=[c.name for c in bodies],
        body_points=_positions(sheet, header + 1, bodies),
    )


def _facts(cells: tuple[str, ...]) -> dict[str, str]:
    """Return the first line's ``key, value, key, value`` pairs, a value ending where a known key begins."""
    facts: dict[str, list[str]] = {}
    key = ""
    for cell in cells:
        if cell.lower() in FACTS:
            key = cell.lower()
            facts[key] = []
        elif key:
            facts[key].append(cell)
    return {key: ", ".join(values).strip(" ,") for key, values in facts.items()}


def _rate(facts: dict[str, str], decimal: str) -> float | None:
    for key in ("export frame rate", "capture frame rate"):
        rate = parse(facts.get(key, ""), decimal)
        if rate is not None and math.isfinite(rate) and rate > 0:
            return rate
    return None


def _columns(path: Path, header: list[tuple[str, ...]], line: int) -> list[_Column]:
    """Group the columns by point: rows of types and names, a row with Position, and the row of axes.

    Rows are told by their labels, or (Motive 1.21 leaves those empty) by what stands in them.
    """
    axes, above = header[-1], header[:-1]
    labelled = {cells[1].lower(): cells for cells in above if len(cells) > 1 and cells[1]}
    known = {*MARKER_TYPES, *BODY_TYPES}
    types = labelled.get("type") or next((c for c in above if any(v.lower() in known for v in c[2:])), None)
    names = labelled.get("name")
    if names is None and types is not None:
        names = next(iter(above[above.index(types) + 1 :]), None)
    kinds = next((c for c in above if any(v.lower() == "position" for v in c)), None)
    for row, word in ((types, "Type"), (names, "Name"), (kinds, "Position")):
        if row is None or row is axes:
            raise InputError(f"{path}:{line}: the header has no row '{word}' above this line")
    assert types is not None and names is not None and kinds is not None

    def cell(row: tuple[str, ...], column: int) -> str:
        return row[column] if column < len(row) else ""

    found = []
    for column in range(2, len(axes) - 2):
        triple = tuple(cell(axes, column + i).upper() for i in range(3))
        places = {cell(kinds, column + i).lower() for i in range(3)}
        if triple == AXES and places == {"position"}:
            found.append(
                _Column(cell(types, column).lower(), cell(names, column), (column, column + 1, column + 2))
            )
    if not found:
        raise InputError(f"{path}:{line}: no column holds positions X, Y, Z")
    return found


def _unique(columns: list[_Column]) -> list[_Column]:
    """Keep one column per name: what the cameras saw (Marker) rather than a rigid body's model of it."""
    best: dict[str, _Column] = {}
    for column in columns:
        if column.name not in best or column.type == "marker":
            best[column.name] = column
    return list(best.values())


def _positions(sheet: Sheet, first: int, columns: list[_Column]) -> Array:
    if not columns:
        return np.empty((len(sheet.rows) - first, 0, 3))
    flat = sheet.numbers(first, [k for c in columns for k in c.columns])
    return flat.reshape(len(flat), -1, 3)


def _read_rows(sheet: Sheet, settings: ReadSettings) -> Take:
    """Read format 1.1: ``frame, number, time, bodies (11 values each), markers (x, y, z, id, name each)``."""
    path, told = sheet.path, list(sheet.told)
    rows = [(line, cells) for line, cells in sheet.rows if cells[0].lower() == "frame"]
    if not rows:
        raise InputError(f"{path}: holds no line that starts with 'frame'")
    seen: list[dict[str, tuple[float, float, float]]] = []
    clock = np.empty((len(rows), 2))
    for i, (line, cells) in enumerate(rows):
        clock[i] = [_value(path, line, cells, k, sheet.decimal) for k in (1, 2)]
        bodies = _count(path, line, cells, 3, sheet.decimal)
        start = 4 + 11 * bodies
        frame: dict[str, tuple[float, float, float]] = {}
        for k in range(_count(path, line, cells, start, sheet.decimal)):
            at = start + 1 + 5 * k
            x, y, z = (_value(path, line, cells, at + j, sheet.decimal) for j in range(3))
            frame[_text(path, line, cells, at + 4) or _text(path, line, cells, at + 3)] = (x, y, z)
        seen.append(frame)
    labels = tuple(dict.fromkeys(name for frame in seen for name in frame))
    points = np.full((len(rows), len(labels), 3), np.nan)
    for i, frame in enumerate(seen):
        for name, place in frame.items():
            points[i, labels.index(name)] = place
    frames = Frames(clock[:, 1], clock[:, 0], [line for line, _ in rows])
    return take_of(path, frames, settings.rate_hz, labels, points, told, scale_m=settings.scale_m)


def _text(path: Path, line: int, cells: tuple[str, ...], k: int) -> str:
    if k >= len(cells):
        raise InputError(f"{path}:{line}: the frame ends after {len(cells)} cells")
    return cells[k]


def _value(path: Path, line: int, cells: tuple[str, ...], k: int, decimal: str) -> float:
    value = parse(_text(path, line, cells, k), decimal)
    if value is None:
        raise InputError(f"{path}:{line}: expected a number, found '{printable(cells[k])}'")
    return value


def _count(path: Path, line: int, cells: tuple[str, ...], k: int, decimal: str) -> int:
    value = _value(path, line, cells, k, decimal)
    if not (0 <= value <= len(cells)) or value != int(value):
        raise InputError(
            f"{path}:{line}: expected a number of markers or bodies, found '{printable(cells[k])}'"
        )
    return int(value)

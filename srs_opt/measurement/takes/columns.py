"""Any table of positions: headings such as ``t [ms], head x [mm]``, or columns named by a person."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from srs_opt.document import load_schema, read_yaml, unknown_word, validate
from srs_opt.errors import InputError
from srs_opt.measurement.takes.sheet import Sheet, parse, read_sheet
from srs_opt.measurement.takes.take import SECONDS, UNITS, Frames, ReadSettings, Take, take_of

_UNIT = re.compile(r"[\[(]\s*([^\])]*?)\s*[\])]|[_ ](mm|cm|m|ms|s|px)$", re.IGNORECASE)
_TIME = ("t", "time", "timestamp", "zeit", "temps", "elapsed", "seconds")
_FRAME = ("frame", "frame#", "frames", "frame number", "framenumber", "index", "sample")
_AXIS_LAST = re.compile(r"^(.*?)[\s_.:/-]*(?<![A-Za-z])?(?:p|pos)?([xyz])$", re.IGNORECASE)
_AXIS_FIRST = re.compile(r"^([xyz])[\s_.:/-]*(.*)$", re.IGNORECASE)
_ROTATION = re.compile(
    r"(?:^|[\s_.:/-])(?:q[xyzw0-3]|q|quat\w*|rot\w*|[xyz]?orient\w*)(?:[\s_.:/-]|$)", re.IGNORECASE
)


@dataclass
class _Layout:
    """Columns by number: time, frame, and per marker one column per axis."""

    time: int | None = None
    frame: int | None = None
    time_scale: float = 1.0
    scale_m: float | None = None
    y_down: bool = False
    pixels: bool = False
    markers: dict[str, dict[str, int]] = field(default_factory=dict)


def load_columns(path: Path) -> dict[str, Any]:
    """Read a file for ``--columns``.

    Raises
    ------
    InputError
        If it breaks the schema.
    """
    document = read_yaml(path, "a description of columns (YAML)")
    validate(document, load_schema("srs_opt.measurement.takes", "columns.schema.json"))
    return dict(document.value)


def is_table(text: str) -> bool:
    """Whether the first line with words names columns of positions."""
    lines = [line for line in text.split("\n") if line.strip()]
    for line in lines[:5]:
        for separator in (",", ";", "\t"):
            cells = [cell.strip().strip('"') for cell in line.split(separator)]
            axes = [axis for axis in (_axis(_split(cell)[0]) for cell in cells) if axis]
            if len(axes) >= 2 and {axis for _, axis in axes} >= {"x"}:
                return True
    return False


def read_columns(path: Path, settings: ReadSettings) -> Take:
    """Read a table of positions.

    Raises
    ------
    InputError
        If no columns of positions can be told.
    """
    sheet = read_sheet(path)
    told = list(sheet.told)
    first = _first_row(sheet)
    if first == 0:
        raise InputError(
            f"{path}:{sheet.rows[0][0]}: the table has no headings (expected time and x, y columns)"
        )
    line, header = sheet.rows[first - 1]
    header = tuple(name.strip('"') for name in header)
    layout = (
        _named(path, header, settings.columns)
        if settings.columns is not None
        else _inferred(path, line, header, told)
    )
    names = tuple(layout.markers)
    points = np.zeros((len(sheet.rows) - first, len(names), 3))
    for k, columns in enumerate(layout.markers.values()):
        for axis, column in columns.items():
            points[:, k, "xyz".index(axis)] = sheet.numbers(first, [column])[:, 0]
    if layout.y_down:
        points[..., 1] *= -1
    time = None if layout.time is None else sheet.numbers(first, [layout.time])[:, 0] * layout.time_scale
    number = None if layout.frame is None else sheet.numbers(first, [layout.frame])[:, 0]
    if time is None and number is None:
        told.append("no column holds a time: every row is taken as the next frame")
    lines = [n for n, _ in sheet.rows[first:]]
    return take_of(
        path,
        Frames(time, number, lines),
        settings.rate_hz,
        names,
        points,
        told,
        scale_m=settings.scale_m or layout.scale_m,
        flat=all("z" not in c for c in layout.markers.values()),
        pixels=layout.pixels or layout.y_down,
    )


def _first_row(sheet: Sheet) -> int:
    """Return the first row that holds numbers as the last rows do."""
    first = len(sheet.rows)
    while first > 0:
        cells = sheet.rows[first - 1][1]
        words = sum(parse(c, sheet.decimal) is None for c in cells)
        if words > len(cells) / 2:
            break
        first -= 1
    if first == len(sheet.rows):
        raise InputError(f"{sheet.path}:{sheet.rows[-1][0]}: no rows of numbers follow the headings")
    return first


def _split(heading: str) -> tuple[str, str]:
    """Return a heading without its unit, and the unit ('' when there is none)."""
    match = _UNIT.search(heading.strip())
    if not match:
        return heading.strip(), ""
    unit = (match.group(1) or match.group(2) or "").strip().lower()
    return (heading[: match.start()] + heading[match.end() :]).strip(" _"), unit


def _axis(name: str) -> tuple[str, str] | None:
    """Return (label, axis) of a position's column."""
    if _ROTATION.search(name):
        return None
    match = _AXIS_FIRST.match(name)
    if match and (not match.group(2) or match.group(2)[:1].isdigit() or not name[1:2].isalpha()):
        return match.group(2), match.group(1).lower()
    match = _AXIS_LAST.match(name)
    if match and (not match.group(1) or not name[-2:-1].isalpha() or name[-1].isupper()):
        return match.group(1).strip(" _.:/-"), match.group(2).lower()
    return None


def _inferred(path: Path, line: int, header: tuple[str, ...], told: list[str]) -> _Layout:
    layout, units, others = _Layout(), set(), []
    for k, heading in enumerate(header):
        name, unit = _split(heading)
        axis = _axis(name)
        if name.lower() in _TIME and layout.time is None:
            layout.time = k
            if unit and unit not in SECONDS:
                raise InputError(f"{path}:{line}: unknown unit of time '{unit[:20]}' (expected s or ms)")
            layout.time_scale = SECONDS.get(unit, 1.0)
            if not unit:
                told.append("the time column states no unit: taken as seconds")
        elif name.lower() in _FRAME and layout.frame is None:
            layout.frame = k
        elif axis:
            layout.markers.setdefault(axis[0] or "point", {})[axis[1]] = k
            units.add(unit)
        elif heading:
            others.append(heading)
    layout.markers = {name: c for name, c in layout.markers.items() if len(c) > 1}
    if not layout.markers:
        raise InputError(
            f"{path}:{line}: no two columns are named x and y of a marker; say which with --columns"
        )
    units.discard("")
    if len(units) > 1 or not units <= {*UNITS, "px", "pixel", "pixels"}:
        raise InputError(f"{path}:{line}: unknown or mixed length units {', '.join(sorted(units))[:60]}")
    unit = next(iter(units), "")
    layout.scale_m = UNITS.get(unit)
    layout.pixels = unit.startswith("p")
    if others:
        told.append(f"columns left out: {', '.join(others)[:120]}")
    return layout


def _named(path: Path, header: tuple[str, ...], columns: dict[str, Any]) -> _Layout:
    def place(name: str | int) -> int:
        if isinstance(name, int):
            if not 1 <= name <= len(header):
                raise InputError(f"{path}: --columns: there is no column {name} (1 to {len(header)})")
            return name - 1
        if name not in header:
            raise InputError(f"{path}: --columns: {unknown_word('column', name, list(header))}")
        return header.index(name)

    return _Layout(
        time=place(columns["time"]) if "time" in columns else None,
        frame=place(columns["frame"]) if "frame" in columns else None,
        time_scale=SECONDS[columns.get("time_unit", "s")],
        scale_m=UNITS.get(columns.get("length_unit", "")),
        y_down=bool(columns.get("y_down", False)),
        markers={
            name: {axis: place(c) for axis, c in zip("xyz", own)} for name, own in columns["markers"].items()
        },
    )

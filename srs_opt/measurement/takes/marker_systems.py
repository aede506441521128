"""Text exports of marker systems: Qualisys TSV, Vicon CSV, TRC (OpenSim and others)."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.records import Array
from srs_opt.measurement.takes.sheet import Sheet, parse, read_sheet
from srs_opt.measurement.takes.take import (
    Frames,
    ReadSettings,
    Take,
    take_of,
    unit_scale,
)

BODY_COLUMNS = 16  # of a rigid body in a 6D TSV: position, three angles, residual, rotation matrix


def is_qualisys(head: str) -> bool:
    """Whether a file begins as Qualisys Track Manager's TSV exports do."""
    return head.lstrip("\ufeff").upper().startswith("NO_OF_")


def is_vicon(head: str) -> bool:
    """Whether a file begins as Vicon Nexus's CSV exports do."""
    first = head.lstrip("\ufeff").strip().split("\n", 1)[0].strip(' ,;"\r').lower()
    return first in ("trajectories", "devices", "model outputs", "joints", "segments", "events")


def is_trc(head: str) -> bool:
    """Whether a file begins as TRC files do."""
    return head.lstrip("\ufeff").lower().startswith("pathfiletype")


def read_qualisys(path: Path, settings: ReadSettings) -> Take:
    """Read a TSV export of Qualisys Track Manager (3D, or 6D bodies).

    Raises
    ------
    InputError
        If the file is not such an export.
    """
    sheet = read_sheet(path)
    told = list(sheet.told)
    facts: dict[str, tuple[int, tuple[str, ...]]] = {}
    data = len(sheet.rows)
    for i, (line, cells) in enumerate(sheet.rows):
        if parse(cells[0], sheet.decimal) is not None and cells[0]:
            data = i
            break
        facts[cells[0].upper()] = (line, cells[1:])
    if data == len(sheet.rows):
        raise InputError(f"{path}: no frames follow the header")
    bodies = "BODY_NAMES" in facts
    names = tuple(c for c in facts.get("BODY_NAMES" if bodies else "MARKER_NAMES", (0, ()))[1] if c)
    if not names:
        raise InputError(f"{path}: the header has no row MARKER_NAMES or BODY_NAMES")
    each = BODY_COLUMNS if bodies else 3
    width = max(len(cells) for _, cells in sheet.rows[data:])
    extra = width - each * len(names)
    if extra not in (0, 1, 2):
        raise InputError(
            f"{path}:{sheet.rows[data][0]}: {width} columns where {len(names)} names make {each * len(names)}"
        )
    columns = [extra + each * k + j for k in range(len(names)) for j in range(3)]
    points = sheet.numbers(data, columns).reshape(-1, len(names), 3)
    points = _without_zeros(points, told)
    rate = settings.rate_hz or _number(facts.get("FREQUENCY", (0, ("",)))[1], sheet.decimal)
    clock = sheet.numbers(data, list(range(extra)))
    lines = [line for line, _ in sheet.rows[data:]]
    frames = Frames(clock[:, 1] if extra == 2 else None, clock[:, 0] if extra else None, lines)
    if settings.scale_m is None:
        told.append("a TSV export states no units; Qualisys writes millimetres")
    scale, nothing = settings.scale_m or 1e-3, points[:, :0]
    if bodies:
        return take_of(path, frames, rate, (), nothing, told, scale_m=scale, bodies=names, body_points=points)
    return take_of(path, frames, rate, names, points, told, scale_m=scale)


def _without_zeros(points: Array, told: list[str]) -> Array:
    """Take positions of exactly (0, 0, 0) as lost: so are gaps written by some exports."""
    zero = (points == 0).all(axis=2)
    if zero.any():
        told.append(f"{int(zero.sum())} positions of exactly 0, 0, 0 count as lost")
    return np.where(zero[..., None], np.nan, points)


def _number(cells: tuple[str, ...], decimal: str) -> float | None:
    value = parse(cells[0], decimal) if cells else None
    return value if value is not None and math.isfinite(value) and value > 0 else None


def read_vicon(path: Path, settings: ReadSettings) -> Take:
    """Read the section Trajectories of a CSV export of Vicon Nexus.

    Raises
    ------
    InputError
        If there is no such section.
    """
    sheet = read_sheet(path)
    told = list(sheet.told)
    rows = sheet.rows
    at = next((i for i, (_, c) in enumerate(rows) if c[0].lower() == "trajectories"), None)
    if at is None or at + 5 >= len(rows):
        raise InputError(f"{path}: no section 'Trajectories' with frames (export it along with the others)")
    rate = settings.rate_hz or _number(rows[at + 1][1], sheet.decimal)
    names_row, axes = rows[at + 2][1], rows[at + 3][1]
    if not axes or axes[0].lower() != "frame":
        raise InputError(f"{path}:{rows[at + 3][0]}: expected the row Frame, Sub Frame, X, Y, Z")
    units = next((c for c in rows[at + 4][1] if c), "")
    starts = [k for k in range(2, len(axes) - 2) if [a.upper() for a in axes[k : k + 3]] == ["X", "Y", "Z"]]
    names = tuple(
        (names_row[k] if k < len(names_row) else "").split(":")[-1] or f"marker {i + 1}"
        for i, k in enumerate(starts)
    )
    if not starts:
        raise InputError(f"{path}:{rows[at + 3][0]}: no column holds positions X, Y, Z")
    first, last = at + 5, at + 5
    while last < len(rows) and rows[last][1][0] and parse(rows[last][1][0], sheet.decimal) is not None:
        last += 1
    part = Sheet(path, rows[:last], sheet.separator, sheet.decimal, sheet.told)
    points = part.numbers(first, [k + j for k in starts for j in range(3)]).reshape(-1, len(starts), 3)
    number = part.numbers(first, [0])[:, 0] - 1  # Nexus counts frames from 1
    frames = Frames(None, number, [line for line, _ in rows[first:last]])
    scale = settings.scale_m or (unit_scale(path, rows[at + 4][0], units) if units else None)
    return take_of(path, frames, rate, names, points, told, scale_m=scale)


def read_trc(path: Path, settings: ReadSettings) -> Take:
    """Read a TRC file.

    Raises
    ------
    InputError
        If the file is not a TRC file.
    """
    sheet = read_sheet(path, _trc_style(path))
    told = list(sheet.told)
    rows = sheet.rows
    if len(rows) < 6 or rows[3][1][0].lower() not in ("frame#", "frame"):
        raise InputError(f"{path}: expected the row 'Frame#, Time, names' on the fourth line")
    facts = {key.lower(): value for key, value in zip(rows[1][1], rows[2][1])}
    rate = settings.rate_hz or _number((facts.get("datarate", ""),), sheet.decimal)
    width = max(len(cells) for _, cells in rows[5:])
    names = tuple(c for c in rows[3][1][2:] if c)
    if not names or width > 2 + 3 * len(names) + 1 or width < 3 * len(names):
        raise InputError(
            f"{path}:{rows[5][0]}: {width} columns where {len(names)} names make {2 + 3 * len(names)}"
        )
    first = 5 if parse(rows[4][1][0], sheet.decimal) is None or not rows[4][1][0] else 4
    points = sheet.numbers(first, list(range(2, 2 + 3 * len(names)))).reshape(-1, len(names), 3)
    points = _without_zeros(points, told)
    clock = sheet.numbers(first, [0, 1])
    frames = Frames(clock[:, 1], clock[:, 0], [line for line, _ in rows[first:]])
    units = facts.get("units", "")
    scale = settings.scale_m or (unit_scale(path, 3, units) if units else None)
    return take_of(path, frames, rate, names, points, told, scale_m=scale)


def _trc_style(path: Path) -> tuple[str, str]:
    """TRC files are separated by tabs, which empty cells need; only the decimal sign has to be found."""
    found = read_sheet(path)
    return ("\t", found.decimal) if found.separator != "," else (",", ".")

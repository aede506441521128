"""C3D files (by ezc3d) and DeepLabCut's tables, CSV or HDF5 (the latter by pandas)."""

from __future__ import annotations

import importlib
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from srs_opt.errors import InputError
from srs_opt.files import read_bytes, temporary_folder
from srs_opt.measurement.records import Array
from srs_opt.measurement.takes.sheet import read_sheet
from srs_opt.measurement.takes.take import (
    Frames,
    ReadSettings,
    Take,
    take_of,
    unit_scale,
)

MOST_BYTES = 512 * 1024 * 1024


def _library(name: str, path: Path) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise InputError(
            f"{path}: reading this format needs {name}: pip install 'srs-opt[tracks]'"
        ) from error


def read_c3d(path: Path, settings: ReadSettings) -> Take:
    """Read the points of a C3D file.

    Raises
    ------
    InputError
        If the file is no C3D file, or ezc3d is not installed.
    """
    head = read_bytes(path, "a C3D file", MOST_BYTES)[:2]
    if len(head) < 2 or head[1] != 0x50:
        raise InputError(f"{path}: not a C3D file (its second byte must be 0x50)")
    _library("ezc3d", path)
    record = _by_child(path)
    values, labels = record["points"], tuple(str(name) for name in record["labels"])
    rate, first = float(record["rate"]), int(record["first"])
    units = str(record["units"]).strip()
    points = np.asarray(values, dtype=float).transpose(2, 1, 0)
    if not points.size:
        raise InputError(f"{path}: holds no points")
    told: list[str] = []
    labels = tuple(labels[k] if k < len(labels) else f"point {k + 1}" for k in range(points.shape[1]))
    numbers = first + np.arange(len(points), dtype=float)
    frames = Frames(None, numbers, range(1, len(points) + 1))
    rate_hz = settings.rate_hz or (rate if np.isfinite(rate) and rate > 0 else None)
    scale = settings.scale_m or (unit_scale(path, 1, units) if units else None)
    return take_of(path, frames, rate_hz, labels, points, told, scale_m=scale)


# ezc3d ends the process on some damaged files, so a child process reads
_CHILD = """
import sys, ezc3d, numpy
r = ezc3d.c3d(sys.argv[1])
p, h = r["parameters"]["POINT"], r["header"]["points"]
text = lambda key: [str(v).strip() for v in p.get(key, {}).get("value", [])]
numpy.savez(sys.argv[2], points=r["data"]["points"][:3], labels=numpy.array(text("LABELS"), dtype=str),
            rate=h["frame_rate"], first=h["first_frame"], units=(text("UNITS") or [""])[0])
"""
_PATIENCE_S = 120


def _by_child(path: Path) -> dict[str, Any]:
    with temporary_folder() as folder:
        made = folder / "points.npz"
        command = [sys.executable, "-c", _CHILD, str(path.resolve()), str(made)]
        try:
            done = subprocess.run(command, capture_output=True, timeout=_PATIENCE_S, check=False, text=True)
        except subprocess.TimeoutExpired as error:
            raise InputError(f"{path}: reading the C3D file takes over {_PATIENCE_S} s: damaged?") from error
        if done.returncode != 0 or not made.is_file():
            words = (done.stderr.strip().splitlines() or ["ezc3d ended on it"])[-1]
            raise InputError(f"{path}: cannot be read as a C3D file: {words[:200]}")
        with np.load(made, allow_pickle=False) as record:
            return dict(record)


def is_deeplabcut(head: str) -> bool:
    """Whether a file begins as DeepLabCut's CSV files do."""
    return head.lstrip("\ufeff").startswith(("scorer,", "scorer;", '"scorer"'))


def read_deeplabcut(path: Path, settings: ReadSettings) -> Take:
    """Read DeepLabCut's CSV table: rows scorer, (individuals,) bodyparts, coords; then one row per frame.

    Raises
    ------
    InputError
        If the file is no such table, or the frame rate is not given (the table does not hold it).
    """
    sheet = read_sheet(path)
    above = {cells[0].lower(): cells for _, cells in sheet.rows[:4]}
    first = next((i for i, (_, c) in enumerate(sheet.rows) if c[0].lower() == "coords"), None)
    if first is None or not {"bodyparts", "coords"} <= set(above):
        raise InputError(f"{path}: expected rows scorer, bodyparts and coords")
    parts, coords = above["bodyparts"], above["coords"]
    animals = above.get("individuals", parts)
    keys = [
        (animals[k] if k < len(animals) else "", parts[k] if k < len(parts) else "", coords[k].lower())
        for k in range(1, len(coords))
    ]
    values = sheet.numbers(first + 1, list(range(1, len(coords))))
    number = sheet.numbers(first + 1, [0])[:, 0]
    lines = [line for line, _ in sheet.rows[first + 1 :]]
    return _video_take(path, settings, keys, values, number, lines, list(sheet.told))


def read_deeplabcut_h5(path: Path, settings: ReadSettings) -> Take:
    """Read DeepLabCut's HDF5 table.

    Raises
    ------
    InputError
        If the file is no such table, or pandas (with tables) is not installed.
    """
    head = read_bytes(path, "an HDF5 file", MOST_BYTES)[:8]
    if head != b"\x89HDF\r\n\x1a\n":
        raise InputError(f"{path}: not an HDF5 file")
    pandas = _library("pandas", path)
    _library("tables", path)
    try:
        table: Any = pandas.read_hdf(path)
        keys = []
        for column in table.columns:
            words = [str(word) for word in column]
            keys.append((words[1] if len(words) > 3 else words[-2], words[-2], words[-1].lower()))
        values = np.asarray(table.to_numpy(), dtype=float)
        number = np.arange(len(values), dtype=float)
    except Exception as error:  # whatever pandas or HDF5 raise, the file is at fault
        raise InputError(f"{path}: cannot be read as a DeepLabCut table: {error}") from error
    return _video_take(path, settings, keys, values, number, range(1, len(values) + 1), [])


def _video_take(
    path: Path,
    settings: ReadSettings,
    keys: list[tuple[str, str, str]],
    values: Array,
    number: Array,
    lines: Any,
    told: list[str],
) -> Take:
    """Make a take of pixel positions: y turned up, unsure positions taken out."""
    names = list(dict.fromkeys(key[:2] for key in keys))
    points = np.full((len(values), len(names), 3), np.nan)
    points[..., 2] = 0.0
    unsure = np.zeros(points.shape[:2], dtype=bool)
    for k, (animal, part, coordinate) in enumerate(keys):
        place = names.index((animal, part))
        if coordinate in ("x", "y"):
            points[:, place, "xy".index(coordinate)] = values[:, k] * (1.0 if coordinate == "x" else -1.0)
        elif coordinate == "likelihood":
            unsure[:, place] = ~(values[:, k] >= settings.least_likelihood)
    told.append("pictures count y downwards: turned up")
    if unsure.any():
        told.append(
            f"{100 * unsure.mean():.1f} % of the positions are less sure than {settings.least_likelihood:g} "
            "and count as lost"
        )
    points[unsure] = np.nan
    several = len({animal for animal, _ in names if animal}) > 1 and any(a != p for a, p in names)
    return take_of(
        path,
        Frames(None, number, lines),
        settings.rate_hz,
        [f"{a} {p}" if several else p for a, p in names],
        points,
        told,
        scale_m=settings.scale_m,
        flat=True,
        pixels=True,
    )

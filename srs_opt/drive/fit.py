"""Calibrating a drive by a measured map: the same gaits simulated, factors fitted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from srs_opt.drive.calibration import DriveCalibration, fit_calibration
from srs_opt.errors import InputError
from srs_opt.files import read_text
from srs_opt.gait_map.grid import map_points
from srs_opt.measurement.bench_files import MAP_COLUMNS
from srs_opt.robot import Robot

_COLUMNS = MAP_COLUMNS[: MAP_COLUMNS.index("replicates")]


@dataclass(frozen=True)
class MeasuredMap:
    """Measured speed and radius per gait; rows as in the columns of maps.csv, radius NaN when straight."""

    rows: np.ndarray


def load_measured_map(path: Path | str) -> MeasuredMap:
    """Read a maps.csv (columns frequency_hz ... radius_sd_m; more columns are ignored).

    Raises
    ------
    InputError
        Naming file and line of the first thing that does not fit.
    """
    lines = [line for line in read_text(path, "a measured map (CSV)").splitlines() if line.strip()]
    header = lines[0].split(",") if lines else []
    missing = [c for c in _COLUMNS if c not in header]
    if missing:
        raise InputError(f"{path}:1: column '{missing[0]}' is missing (expected {','.join(_COLUMNS)})")
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        cells = dict(zip(header, line.split(",")))
        try:
            rows.append([float(cells.get(c) or "nan") for c in _COLUMNS])
        except ValueError as error:
            raise InputError(f"{path}:{number}: expected numbers, found '{line[:60]}'") from error
    if not rows:
        raise InputError(f"{path}: the measured map has no rows")
    return MeasuredMap(np.array(rows))


def calibrate_drive(robot: Robot, model: str, measured: MeasuredMap) -> DriveCalibration:
    """Simulate the measured gaits and fit the drive's factors.

    Raises
    ------
    InputError
        If nothing can be compared.
    """
    points = [(float(f), float(p), float(o), float(g)) for f, p, o, g in measured.rows[:, :4]]
    simulated = np.array(map_points(robot, model, points))
    speed, speed_sd, radius, radius_sd = measured.rows[:, 4:].T
    # tracks give a radius to straight runs too; only gaits that turn in the model say something
    return fit_calibration(simulated[:, 4], simulated[:, 6], speed, speed_sd, radius, radius_sd)

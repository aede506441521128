"""Calibrating a drive by a measured map: the same gaits simulated, factors fitted."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from srs_opt.drive.calibration import DriveCalibration, fit_calibration
from srs_opt.gait_map.grid import map_points
from srs_opt.measurement.bench_files import read_map_rows
from srs_opt.problem import Report
from srs_opt.robot import Robot
from srs_opt.table import first_error


@dataclass(frozen=True)
class MeasuredMap:
    """Measured speed and radius per gait; rows as in the columns of maps.csv, radius NaN when straight."""

    rows: np.ndarray


def load_measured_map(path: Path | str) -> MeasuredMap:
    """Read a maps.csv, as a data set's is read.

    Raises
    ------
    InputError
        Naming file and line of the first thing that does not fit.
    """
    path = Path(path)
    report = Report(path.parent)
    rows = read_map_rows(path.name, report)
    first_error(report)
    return MeasuredMap(
        np.array(
            [
                [
                    *(row.frequency_hz, row.pressure_kpa, row.offset, row.phase_lag_rad),
                    *(row.speed_m_s, row.speed_sd_m_s),
                    math.nan if row.radius_m is None else row.radius_m,
                    math.nan if row.radius_sd_m is None else row.radius_sd_m,
                ]
                for row in rows
            ]
        )
    )


def calibrate_drive(robot: Robot, measured: MeasuredMap, model: str | None = None) -> DriveCalibration:
    """Simulate the measured gaits and fit the drive's factors.

    Raises
    ------
    InputError
        If nothing can be compared.
    """
    points = [(float(f), float(p), float(o), float(g)) for f, p, o, g in measured.rows[:, :4]]
    simulated = np.array(map_points(robot, model or robot.own_model, points))
    speed, speed_sd, radius, radius_sd = measured.rows[:, 4:].T
    # tracks give a radius to straight runs too; only gaits that turn in the model say something
    return fit_calibration(simulated[:, 4], simulated[:, 6], speed, speed_sd, radius, radius_sd)

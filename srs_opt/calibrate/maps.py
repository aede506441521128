"""Calibration from maps alone: speeds and radii of steady gaits, which know much less than tracks."""

from __future__ import annotations

import math

import numpy as np

from srs_opt.calibrate.coordinates import FRICTION_SPEED, SCATTER_SD, Coordinate, base_coordinates
from srs_opt.calibrate.fit import Fit, Point
from srs_opt.calibrate.result import Calibration, calibration
from srs_opt.errors import NoAnswerError
from srs_opt.gait import Wave
from srs_opt.measurement.records import DataSet, MapRow
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import Robot

ITERATIONS = 4
STEP = 0.01  # of a log; speeds are smooth in the parameters well beyond this
MOST_ROWS = 60
LEAST_SD_M_S = 1e-4


def fit_maps(dataset: DataSet, model: str = "complex") -> Calibration:
    """Fit the robot's parameters to speed and turn rate of every row of maps.csv.

    Sensitivities are central differences of the steady gait: two dozen orbits per row and iteration, each
    accurate to 1e-4, over steps a hundred times that. The mean over replicates still carries the scatter of
    friction and curvature from run to run; where the stated deviation is smaller, that is what counts.

    Raises
    ------
    NoAnswerError
        If no gait of the maps has a steady state.
    """
    robot = dataset.robot
    base = tuple(c for c in base_coordinates(robot) if c.name != FRICTION_SPEED)
    rows = dataset.maps[:: max(1, math.ceil(len(dataset.maps) / MOST_ROWS))]
    values = np.zeros(len(base))
    precision = np.array([c.prior_sd**-2 for c in base])
    first = None
    for _ in range(ITERATIONS):
        residual, slopes = _linearise(robot, base, values, rows, model)
        first = residual if first is None else first
        matrix = slopes.T @ slopes + np.diag(precision)
        step = np.linalg.solve(matrix, slopes.T @ residual - precision * values)
        values = values + np.clip(step, -0.2, 0.2)
        if np.abs(step).max() < 1e-3:
            break
    residual, slopes = _linearise(robot, base, values, rows, model)
    covariance = np.linalg.inv(slopes.T @ slopes + np.diag(precision))
    point = Point({c.name: float(v) for c, v in zip(base, values)})
    ratio = float(residual @ residual / max(residual.size, 1))
    assert first is not None
    found = Fit(base, point, covariance, float(residual @ residual), ratio, 1.0, {}, ITERATIONS, True)
    return calibration(robot, found, math.sqrt(float(first @ first) / first.size), math.sqrt(ratio))


def _robot(robot: Robot, base: tuple[Coordinate, ...], values: np.ndarray) -> Robot:
    changes = {c.name: getattr(robot, c.name) * math.exp(v) for c, v in zip(base, values)}
    return robot.with_values(**changes)


def _linearise(
    robot: Robot, base: tuple[Coordinate, ...], values: np.ndarray, rows: tuple[MapRow, ...], model: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return whitened residuals (2 rows,) and their slopes (2 rows, K)."""
    here = _motions(_robot(robot, base, values), rows, model)
    columns = []
    for k in range(len(base)):
        ends = []
        for sign in (1, -1):
            moved = values.copy()
            moved[k] += sign * STEP
            ends.append(_motions(_robot(robot, base, moved), rows, model))
        columns.append((ends[0] - ends[1]) / (2 * STEP))
    slopes = np.stack(columns, axis=2)  # (rows, 2, K)
    residuals, whitened = [], []
    for i, row in enumerate(rows):
        if not np.isfinite(slopes[i]).all():
            continue
        residual, covariance = _row(row, here[i], slopes[i], base)
        root = np.linalg.inv(np.linalg.cholesky(covariance))
        residuals.append(root @ residual)
        whitened.append(root @ slopes[i])
    if not residuals:
        raise NoAnswerError("no gait of the maps has a steady state with this robot")
    return np.concatenate(residuals), np.concatenate(whitened)


def _row(
    row: MapRow, motion: np.ndarray, slopes: np.ndarray, base: tuple[Coordinate, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return a row's residual (speed, turn rate) and covariance: its own and that of the runs' scatter."""
    turn = 0.0 if row.radius_m is None else row.speed_m_s / row.radius_m
    speed_sd = max(row.speed_sd_m_s, LEAST_SD_M_S) / math.sqrt(max(row.replicates, 1))
    radius_part = 0.0 if not row.radius_m else (row.radius_sd_m or 0.0) / row.radius_m**2 * row.speed_m_s
    turn_sd = math.hypot(radius_part, 0.02) / math.sqrt(max(row.replicates, 1))
    names = [c.name for c in base]
    scatter = np.zeros((2, 2))
    for name, sd in SCATTER_SD.items():
        if name in names:
            slope = slopes[:, names.index(name)]
            scatter += np.outer(slope, slope) * sd**2 / max(row.replicates, 1)
    own = np.diag([speed_sd**2, turn_sd**2])
    return np.array([row.speed_m_s, turn]) - motion, own + scatter


def _motions(robot: Robot, rows: tuple[MapRow, ...], model: str) -> np.ndarray:
    """Return speed and turn rate of every row's gait, (rows, 2); NaN where there is no steady state."""
    found = np.full((len(rows), 2), np.nan)
    for i, row in enumerate(rows):
        wave = Wave.uniform(robot.segments, row.frequency_hz, row.pressure_kpa, row.phase_lag_rad, row.offset)
        try:
            orbit = steady_gait(robot, wave.gait(), model)
        except NoAnswerError:
            continue
        found[i] = abs(orbit.speed_m_s), orbit.turn_rate_rad_s
    return found

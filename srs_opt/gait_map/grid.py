"""The map: steady motion at every point of a grid of waves."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from srs_opt.errors import InputError
from srs_opt.files import write_with
from srs_opt.gait import Wave
from srs_opt.parallel import executor
from srs_opt.parallel.sweep import Resume, sweep
from srs_opt.result import Result
from srs_opt.robot import Robot
from srs_opt.table import first_error, read_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SETTINGS = ("frequency_hz", "pressure_kpa", "offset", "phase_lag_rad")
COLUMNS = (
    *SETTINGS,
    "speed_m_s",
    "turn_rate_rad_s",
    "radius_m",
    "envelope_right_m",
    "envelope_left_m",
)
Point = tuple[float, float, float, float]
LARGEST_MAP = 1_000_000
_CHUNK = 96


@dataclass(frozen=True, repr=False)
class GaitMap(Result):
    """Steady motion over (frequency, pressure, offset, lag); one row per gait, columns as in COLUMNS.

    `rows` is (n, 9); the radius is NaN where the robot runs straight.
    """

    rows: np.ndarray

    def column(self, name: str) -> np.ndarray:
        """Return one column, (n,)."""
        return self.rows[:, COLUMNS.index(name)]

    def to_dict(self) -> dict[str, Any]:
        """Return the columns as lists; None where there is no value."""
        columns = {name: self.column(name).tolist() for name in COLUMNS}
        return {name: [v if math.isfinite(v) else None for v in values] for name, values in columns.items()}

    def in_words(self) -> str:
        """Return the number of gaits and the fastest of them."""
        speed = np.abs(self.column("speed_m_s"))
        fastest = f"fastest {np.nanmax(speed):.3f} m/s" if np.isfinite(speed).any() else "none of them steady"
        return f"{len(self.rows)} gaits, {fastest}"

    def save(self, path: Path | str) -> Path:
        """Write map.csv, a row per gait."""
        return save_map(self, path)

    def figure(self) -> Figure:
        """Return the sheet of the first phase lag: speed above, radius below, a column per offset.

        Raises
        ------
        InputError
            If the map has a single frequency or pressure.
        """
        from srs_opt.gait_map.figures import map_figures

        sheets = map_figures(self)
        if not sheets:
            raise InputError("a map is drawn over at least two frequencies and two pressures")
        return next(iter(sheets.values()))


def grid_points(
    frequencies_hz: Sequence[float],
    pressures_kpa: Sequence[float],
    offsets: Sequence[float],
    lags_rad: Sequence[float],
) -> list[Point]:
    """Return all combinations, the frequency running fastest (neighbours help each other's start)."""
    count = len(frequencies_hz) * len(pressures_kpa) * len(offsets) * len(lags_rad)
    if count > LARGEST_MAP:
        raise InputError(f"map of {count} gaits is too large (limit {LARGEST_MAP}); ask for fewer steps")
    return [(f, p, o, g) for g in lags_rad for o in offsets for p in pressures_kpa for f in frequencies_hz]


def map_points(robot: Robot, model: str, points: Sequence[Point]) -> list[tuple[float, ...]]:
    """Return a row of COLUMNS per point; a gait without a steady state gives NaN."""
    from srs_opt.orbit.steady import Orbit, steady_gaits

    gaits = [Wave.uniform(robot.segments, f, p, lag, offset).gait() for f, p, offset, lag in points]
    rows: list[tuple[float, ...]] = []
    for point, orbit in zip(points, steady_gaits(robot, gaits, model)):
        if isinstance(orbit, Orbit):
            radius = np.nan if orbit.radius_m is None else orbit.radius_m
            rows.append((*point, orbit.speed_m_s, orbit.turn_rate_rad_s, radius, *orbit.envelope_m))
        else:
            rows.append((*point, *[np.nan] * 5))
    return rows


def gait_map(
    robot: Robot,
    frequencies_hz: Sequence[float],
    pressures_kpa: Sequence[float],
    offsets: Sequence[float] = (0.0,),
    lags_rad: Sequence[float] | None = None,
    *,
    model: str | None = None,
    jobs: int = 1,
) -> GaitMap:
    """Return the steady motion of all combinations of the paper's wave.

    Parameters
    ----------
    robot : Robot
    frequencies_hz, pressures_kpa, offsets : sequences of float
    lags_rad : sequence of float, optional
        Phase lag of every segment behind the one before it; default: one wave along the body.
    model : str, optional
        Default: the robot's own.
    jobs : int
        Processes; the map does not depend on them.

    Raises
    ------
    InputError
        For offsets that leave a valve for ever on or off, or waves that are not valid.

    Examples
    --------
    >>> import srs_opt as srs
    >>> speeds = srs.gait_map(srs.wpi_srs(), frequencies_hz=[1, 2], pressures_kpa=[41, 55])
    >>> speeds.column("speed_m_s").round(2)
    array([0.08, 0.22, 0.09, 0.23])
    """
    lags = [2 * math.pi / robot.segments] if lags_rad is None else lags_rad
    points = grid_points(frequencies_hz, pressures_kpa, offsets, lags)
    return map_at(robot, model or robot.own_model, points, jobs=jobs)


def map_at(
    robot: Robot,
    model: str,
    points: Sequence[Point],
    *,
    jobs: int = 1,
    cluster: str | None = None,
    quiet: bool = True,
    resume: Path | None = None,
) -> GaitMap:
    """Return the map over `points` (frequency Hz, pressure kPa, offset, lag rad).

    With the folder `resume`, gaits found there are not computed again; it is left for the caller to remove.

    Raises
    ------
    InputError
        For offsets that leave a valve for ever on or off, or waves that are not valid.
    """
    for point in points:
        Wave.uniform(robot.segments, point[0], point[1], point[3], point[2])
    work = partial(map_points, robot, model)
    kept = None if resume is None else Resume(resume, f"gait map {robot} {model}")
    table = np.empty((len(points), len(COLUMNS)))
    with executor(jobs, cluster) as where:
        rows = sweep(work, points, chunk=_CHUNK, where=where, what="gaits", quiet=quiet, resume=kept)
        for k, row in enumerate(rows):
            table[k] = row
    return GaitMap(table)


def save_map(gaits: GaitMap, path: Path | str) -> Path:
    """Write map.csv; the radius is empty where the robot runs straight."""

    def fill(stream: IO[str]) -> None:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows([["" if np.isnan(v) else f"{v:.8g}" for v in row] for row in gaits.rows])

    return write_with(path, fill)


def load_map(path: Path | str) -> GaitMap:
    """Read a map.csv.

    Raises
    ------
    InputError
        Naming file and line of the first row that does not fit.
    """
    rows, report = read_table(path, COLUMNS)
    values = [
        [row.number(c, report, None if k < len(SETTINGS) else math.nan) for k, c in enumerate(COLUMNS)]
        for row in rows
    ]
    first_error(report)
    return GaitMap(np.array(values))

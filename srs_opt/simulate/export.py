"""Trajectories as CSV."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import IO

import numpy as np

from srs_opt.files import write_with
from srs_opt.simulate.integrate import Trajectory
from srs_opt.simulate.interpolate import linear


def write_trajectory(trajectory: Trajectory, path: Path, rate_hz: float = 100.0) -> Path:
    """Write time, pose, curvatures and friction work at `rate_hz`, no-load curvatures of soft bodies."""
    count = int(trajectory.time_s[-1] * rate_hz + 1e-9) + 1
    times = np.arange(count) / rate_hz
    pose, kappa = trajectory.at(times)
    work = linear(trajectory.time_s, trajectory.work_j, times)
    header = ["time_s", "x_m", "y_m", "heading_rad"]
    header += [f"kappa{i + 1}_1_m" for i in range(kappa.shape[1])] + ["friction_work_j"]
    columns = [times, pose, kappa, work]
    if not np.array_equal(trajectory.no_load, trajectory.kappa):
        header += [f"no_load{i + 1}_1_m" for i in range(kappa.shape[1])]
        columns.append(linear(trajectory.time_s, trajectory.no_load, times))

    def fill(stream: IO[str]) -> None:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        table = np.column_stack(columns)
        writer.writerows([[f"{v:.6g}" for v in row] for row in table])

    return write_with(path, fill)

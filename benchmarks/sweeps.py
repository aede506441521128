"""The same map here, in two processes, and on a Dask cluster of this machine's."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from benchmarks.section import Section
from srs_opt.gait_map.grid import GaitMap, grid_points, map_at
from srs_opt.robot import wpi_srs


def run(quick: bool) -> Section:
    from distributed import LocalCluster

    robot = wpi_srs()
    offsets = [0.0, 0.4] if quick else [0.0, 0.2, 0.4, 0.6]
    frequencies, pressures = (4, 3) if quick else (16, 12)
    points = grid_points(
        list(np.linspace(1, 2, frequencies)), list(np.linspace(41, 55, pressures)), offsets, [1.2]
    )
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        address = str(cluster.scheduler_address)
        ways: dict[str, Callable[[], GaitMap]] = {
            "one process": lambda: map_at(robot, "complex", points),
            "two processes": lambda: map_at(robot, "complex", points, jobs=2),
            "two Dask workers": lambda: map_at(robot, "complex", points, cluster=address),
        }
        times, same = {}, {}
        for name, way in ways.items():
            way()  # workers start, libraries load
            started = time.perf_counter()
            same[name] = way().rows
            times[name] = time.perf_counter() - started
    first = same["one process"]
    rows = [
        [name, f"{times[name]:.2f}", "yes" if np.array_equal(first, found, equal_nan=True) else "NO"]
        for name, found in same.items()
    ]
    return Section(f"Sweeps: a map of {len(points)} gaits", ["where", "s (wall)", "same bits"], rows)

"""Steady gaits by the thousand: one by one, side by side, on both cores; how exact; derivatives along."""

from __future__ import annotations

import math
import os

import numpy as np

from benchmarks.rivals import c_loop
from benchmarks.section import Section, best_time
from srs_opt.gait import Gait, Wave
from srs_opt.gait_map.grid import grid_points, map_at
from srs_opt.orbit.sensitivity import sensitivity
from srs_opt.orbit.steady import Orbit, steady_gait, steady_gaits
from srs_opt.robot import wpi_srs

LAG = math.pi / 2
TIGHT = 3e-8  # m/s per step, for reference
CYCLE_S = 1.0


def run(quick: bool) -> Section:
    robot = wpi_srs()
    gaits = _gaits(4 if quick else 21)
    few = gaits[:: 12 if quick else 60]
    steady_gaits(robot, few)
    one_cycle = (
        min(c_loop(Wave.uniform(4, 2, 55, LAG), LAG, 100.0, 5e-4)[0] for _ in range(5)) / 100 * CYCLE_S
    )
    side = best_time(lambda: steady_gaits(robot, gaits), 3) / len(gaits)
    alone = best_time(lambda: [steady_gait(robot, g) for g in few], 3) / len(few)
    orbits = [o for o in steady_gaits(robot, few) if isinstance(o, Orbit)]
    sensitivity(robot, orbits[0])
    slopes = best_time(lambda: [sensitivity(robot, o) for o in orbits], 3) / len(orbits)
    rows = [
        ["steady gait, one by one", f"{1e3 * alone:.2f} ms", f"{alone / one_cycle:.1f}"],
        ["steady gait, side by side", f"{1e3 * side:.2f} ms", f"{side / one_cycle:.1f}"],
        ["all derivatives of one", f"{1e3 * slopes:.2f} ms", f"{slopes / one_cycle:.1f}"],
    ]
    notes = [f"Unit of the last column: the C loop for {CYCLE_S:g} s of motion."]
    if not quick:
        rows += _large(one_cycle)
        notes.append(_accuracy(gaits[::5]))
    ratios = {"side by side over C loop": side / one_cycle, "side by side over one by one": side / alone,
              "derivatives over solution": slopes / alone}  # fmt: skip
    return Section("Steady gaits and maps", ["work", "time", "in C loops"], rows, notes, ratios)


def _gaits(frequencies: int) -> list[Gait]:
    points = grid_points(list(np.linspace(1, 2, frequencies)), [41, 48, 55], [0.0, 0.1, 0.4, 0.7], [LAG, 0.9])
    return [Wave.uniform(4, f, p, lag, offset).gait() for f, p, offset, lag in points]


def _large(one_cycle: float) -> list[list[str]]:
    robot, jobs = wpi_srs(), os.cpu_count() or 1
    full = grid_points(
        list(np.linspace(1, 2, 21)), list(np.linspace(41, 55, 21)), [0.0, 0.1, 0.2, 0.4, 0.6], [LAG]
    )
    rows = []
    for name, points in (("map of 21 x 21 x 5", full), ("batch of 1,000", full[:1000])):
        seconds = best_time(lambda: map_at(robot, "complex", points, jobs=jobs), 2, processor=False)  # noqa: B023
        text = f"{seconds:.1f} s on {jobs} cores (wall)"
        rows.append([f"{name}: {len(points)} gaits", text, f"{seconds / len(points) / one_cycle:.1f} each"])
    return rows


def _accuracy(gaits: list[Gait]) -> str:
    robot = wpi_srs()
    pairs = list(zip(steady_gaits(robot, gaits), steady_gaits(robot, gaits, tolerance=TIGHT)))
    both = [(a, b) for a, b in pairs if isinstance(a, Orbit) and isinstance(b, Orbit)]
    speed = np.array([abs(a.speed_m_s / b.speed_m_s - 1) for a, b in both])
    turns = [(a, b) for a, b in both if b.radius_m is not None]
    turn = np.array([abs(a.turn_rate_rad_s / b.turn_rate_rad_s - 1) for a, b in turns])
    return (
        f"Against tolerance {TIGHT:g} m/s, over {len(both)} gaits (both lags, 41 to 55 kPa, 1 to 2 Hz): "
        f"speed errs by {np.median(speed):.1e} in the median and {speed.max():.1e} at most, turn rate by "
        f"{np.median(turn):.1e} and {turn.max():.1e}."
    )

"""Traverse time: all gaits of the table against one straight gait and its turning companions.

python -m benchmarks.planner_traverse [--contest 3] [--greed 3.0 2.0]

A family is one pressure, one frequency, one set of lags: a straight gait of the table, its offsets varied
to turn, forward and backward. Both sides use the same search; the faster of the plans at the given greeds
counts.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np

from benchmarks.planner_mazes import contest_maze
from planners.maze.load import load_maze
from planners.maze.maze import Maze
from planners.maze.places import RobotSize
from planners.motion.store import load_motion
from planners.motion.table import MotionTable
from planners.plan.solve import solve_with_lattice
from planners.search.lattice import LatticeSettings
from planners.search.problem import Problem
from srs_opt.errors import NoAnswerError
from srs_opt.files import write_json
from srs_opt.gait import Gait
from srs_opt.gait_opt.catalogue import default_table
from srs_opt.gait_opt.table import GaitTable, TableGait
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import Robot, wpi_srs

MARGIN_M = 0.005
OFFSETS = (0.15, 0.3, 0.45, 0.6, 0.7, 0.8)
MAZES = ("first", "u_turn", "slalom", "rooms", "narrow", "blocks")


def companion(gait: Gait, offset: float) -> Gait:
    """Return the gait with every valve on for longer by the offset of (13)."""
    longer = math.asin(offset) / (2 * math.pi) * gait.period_s
    intervals = tuple(
        tuple(((on - longer) % gait.period_s, (off + longer) % gait.period_s) for on, off in pairs)
        for pairs in gait.intervals
    )
    return Gait(gait.period_s, gait.pressure_kpa, intervals)


def family(robot: Robot, entry: TableGait) -> GaitTable:
    """Return a straight gait with its companions, both ways."""
    gaits = {entry.name: entry.gait}
    for offset in OFFSETS:
        gaits[f"{entry.name} {offset:g} left"] = companion(entry.gait, offset)
        gaits[f"{entry.name} {offset:g} right"] = companion(entry.gait, offset).mirrored()
    gaits |= {f"{name} back": gait.reversed_wave() for name, gait in dict(gaits).items()}
    entries = []
    for name, gait in gaits.items():
        try:
            entries.append(TableGait.of_orbit(name, steady_gait(robot, gait)))
        except NoAnswerError:
            continue
    return GaitTable(robot.name, robot.fingerprint(), "complex", tuple(entries))


def duration(
    robot: Robot, gaits: GaitTable, motion: MotionTable, maze: Maze, greeds: list[float]
) -> float | None:
    """Return the traverse time of the best certified plan, s; None without one."""
    times = []
    for greed in greeds:
        problem = Problem(robot, gaits, motion, maze, MARGIN_M)
        plan = solve_with_lattice(
            problem, LatticeSettings(greed=greed), max_nodes=6000, time_limit_s=120.0
        ).plan
        times += [plan.duration_s] if plan else []
    return min(times, default=None)


def main() -> None:
    """Compare and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--contest", type=int, default=3, help="contest mazes at 0.27 m besides our own")
    parser.add_argument("--greed", type=float, nargs="+", default=[3.0, 2.0])
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks/planner_traverse.json"))
    options = parser.parse_args()
    robot = wpi_srs()
    table = default_table(robot)
    straight = [e for e in table.gaits if e.radius_m is None and e.speed_m_s > 0]
    fastest = max(straight, key=lambda e: e.speed_m_s)
    slimmest = min(straight, key=lambda e: sum(e.envelope_m))
    tables = {"whole table": table}
    tables |= {f"only {e.name}": family(robot, e) for e in (fastest, slimmest)}
    motions = {name: load_motion(robot, gaits) for name, gaits in tables.items()}
    size = RobotSize(robot.length_m, robot.body_width_m / 2, MARGIN_M)
    mazes = [load_maze(f"mazes/{name}.yaml") for name in MAZES]
    mazes += [contest_maze(seed, 0.27, size) for seed in range(1, 2 * options.contest, 2)]
    print("traverse time, s    " + "".join(f"{name:>18}" for name in tables))
    rows = []
    for maze in mazes:
        times = {n: duration(robot, tables[n], motions[n], maze, options.greed) for n in tables}
        rows.append({"maze": maze.name, **times})
        cells = "".join(f"{'no plan' if t is None else f'{t:.1f}':>18}" for t in times.values())
        print(f"{maze.name:20}" + cells, flush=True)
    for name in list(tables)[1:]:
        both = [(r["whole table"], r[name]) for r in rows if r["whole table"] and r[name]]
        failed = sum(r[name] is None and r["whole table"] is not None for r in rows)
        shorter = 1 - np.median([a / b for a, b in both]) if both else math.nan
        print(
            f"{name}: the whole table takes {100 * shorter:.0f} % less; it fails in {failed} of {len(rows)}"
        )
    write_json(options.out, rows)
    print(file=sys.stderr)


if __name__ == "__main__":
    main()

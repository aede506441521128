"""Traverse time: all gaits of the table against one straight gait and its turning companions.

python -m benchmarks.planner_traverse [--gaits FILE] [--width 16] [--mazes NAME ...]

A family is what a controller with three knobs plays: one pressure, one frequency, one lag (the same from
segment to segment) and offsets to either side, forward and backward. Families are taken from a grid; the
same planner plans for the table and for each of them. "Straightest" is the family whose straight gait is
the fastest of the grid's, "best" the one that happens to be fastest in the maze at hand.
"""

from __future__ import annotations

import argparse
import random
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.planner_mazes import contest_maze
from benchmarks.section import Section
from planners.generate.areas import corridor
from planners.maze.load import load_maze
from planners.maze.maze import Maze
from planners.maze.places import RobotSize
from planners.motion.store import load_motion
from planners.motion.table import MotionTable
from planners.plan.solve import BEAM, BEAMS, LatticeSolver
from planners.search.problem import Problem
from srs_opt.errors import NoAnswerError
from srs_opt.files import write_json
from srs_opt.gait import Wave
from srs_opt.gait_opt.aim import in_step
from srs_opt.gait_opt.catalogue import default_table
from srs_opt.gait_opt.table import GaitTable, TableGait, load_table
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import Robot, wpi_srs

MARGIN_M = 0.005
TICK_S = 0.001
OFFSETS = (0.0, 0.15, 0.3, 0.45, 0.6, 0.7, 0.8, 0.9)
# frequency Hz, pressure kPa, lag rad: from slim to strong
GRID = ((2.0, 26.0, 1.0), (2.0, 30.0, 0.9), (2.0, 40.0, 0.9), (2.0, 48.0, 0.9), (2.0, 55.0, 0.9))
QUICK_GRID = GRID[2:3]
MAZES = ("first", "u_turn", "slalom", "rooms", "narrow", "blocks", "door 72", "door 66", "door 60", "cells 1")
SLOWEST_M_S = 0.03
LIMIT_NODES, LIMIT_S = 6000, 60.0

Ride = tuple[GaitTable, MotionTable]


def family(robot: Robot, frequency_hz: float, pressure_kpa: float, lag_rad: float) -> GaitTable:
    """Return a straight gait with its companions, both ways."""
    entries = []
    for offset in [sign * size for size in OFFSETS for sign in ((1, -1) if size else (1,))]:
        for way, lag in (("", lag_rad), (" back", -lag_rad)):
            gait = Wave.uniform(robot.segments, frequency_hz, pressure_kpa, lag, offset).gait()
            try:
                entry = TableGait.of_orbit(f"{offset:+g}{way}", steady_gait(robot, in_step(gait, TICK_S)))
            except NoAnswerError:
                continue
            if abs(entry.speed_m_s) > SLOWEST_M_S:
                entries.append(entry)
    return GaitTable(robot.name, robot.fingerprint(), "complex", tuple(entries))


def maze_named(name: str, size: RobotSize) -> Maze:
    """Return one of our mazes, a door so many mm wide in a hall, or a contest maze at 0.27 m."""
    kind, _, number = name.partition(" ")
    if kind == "door":
        room_m = 1e-3 * float(number) + 2 * MARGIN_M
        return corridor(0.4, room_m, 0.4, random.Random(1), size)
    if kind == "cells":
        return contest_maze(int(number), 0.27, size)
    return load_maze(f"mazes/{name}.yaml")


def duration(robot: Robot, ride: Ride, maze: Maze, width: int | None) -> float | None:
    """Return the traverse time of the first certified plan, s; None without one."""
    problem = Problem(robot, *ride, maze, MARGIN_M)
    beams = BEAMS if width is None else (replace(BEAM, width=width),)
    plan = LatticeSolver(problem, beams=beams, time_limit_s=LIMIT_S).run(LIMIT_NODES).plan
    return plan.duration_s if plan else None


def compare(
    table: GaitTable, grid: tuple[tuple[float, float, float], ...], names: tuple[str, ...], width: int | None
) -> tuple[list[str], list[dict[str, float | None]]]:
    """Return the names of the families and the times of the table and of each family, maze by maze."""
    robot = wpi_srs()
    families = {f"{p:g} kPa, {f:g} Hz, {lag:g} rad": family(robot, f, p, lag) for f, p, lag in grid}
    tables = {"whole table": table, **families}
    rides = {name: (gaits, load_motion(robot, gaits)) for name, gaits in tables.items()}
    size = RobotSize(robot.length_m, robot.body_width_m / 2, MARGIN_M)
    rows = []
    for name in names:
        maze = maze_named(name, size)
        rows.append({ride: duration(robot, rides[ride], maze, width) for ride in rides})
        print(name, rows[-1], file=sys.stderr, flush=True)
    fastest = max(families, key=lambda name: max(e.speed_m_s for e in families[name].gaits))
    return [fastest, *families], rows


def shorter(rows: list[dict[str, float | None]], others: list[float | None]) -> float:
    """Return by what share the whole table's times are shorter, in the median over mazes that both do."""
    ours = [row["whole table"] for row in rows]
    ratios = [a / b for a, b in zip(ours, others) if a is not None and b is not None]
    return 1 - float(np.median(ratios)) if ratios else float("nan")


def section(
    table: GaitTable, grid: tuple[tuple[float, float, float], ...], names: tuple[str, ...], width: int | None
) -> Section:
    """Return the comparison as a table."""
    (fastest, *families), rows = compare(table, grid, names, width)
    best = [min((row[f] for f in families if row[f] is not None), default=None) for row in rows]
    straight = [row[fastest] for row in rows]
    alone = [b is None and row["whole table"] is not None for row, b in zip(rows, best)]
    cells = [
        [name, *(_seconds(t) for t in (row["whole table"], s, b))]
        for name, row, s, b in zip(names, rows, straight, best)
    ]
    less = [f"{100 * shorter(rows, others):.0f} %" for others in (straight, best)]
    notes = [
        f"{len(families)} families of one pressure, one frequency and one lag. Against the one with the "
        f"fastest straight gait ({fastest}) the table takes {less[0]} less in the median, against the best "
        f"in hindsight {less[1]}. In {sum(alone)} of {len(rows)} mazes every family fails and the table "
        "does not."
    ]
    columns = ["maze", "whole table, s", "fastest straight gait's family, s", "best family, s"]
    ratio = 1 - shorter(rows, straight)
    return Section("Planner: traverse time", columns, cells, notes, {"traverse time to one family's": ratio})


def _seconds(value: float | None) -> str:
    return "none" if value is None else f"{value:.1f}"


def run(quick: bool) -> Section:
    """Compare, for the report of all benchmarks."""
    table = default_table(wpi_srs())
    if quick:
        return section(table, QUICK_GRID, ("first", "rooms"), None)
    return section(table, GRID, MAZES, None)


def main() -> None:
    """Compare and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gaits", type=Path, help="gait table (default: the shipped one)")
    parser.add_argument("--width", type=int, help="of the beam, for both sides (default: the planner's own)")
    parser.add_argument("--mazes", nargs="+", default=list(MAZES), help="names, 'door MM' or 'cells SEED'")
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks/planner_traverse.json"))
    options = parser.parse_args()
    robot = wpi_srs()
    table = load_table(options.gaits, robot) if options.gaits else default_table(robot)
    result = section(table, GRID, tuple(options.mazes), options.width)
    print(result.markdown())
    write_json(options.out, {"rows": [list(row) for row in result.rows], "notes": list(result.notes)})


if __name__ == "__main__":
    main()

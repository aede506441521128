"""Traverse time: all gaits of the table against one straight gait and its turning companions.

python -m benchmarks.planner_traverse [--gaits FILE] [--width 16] [--mazes NAME ...]

A family is one straight gait, duty-biased to either side, forward and backward: one pressure, one frequency,
one lag. The same planner plans for the table and for each family. "Its own" family is that of the table's
fastest straight gait; the others are uniform waves from a grid, of which "best" is the one that happens to be
fastest in the maze at hand.
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
from planners.plan.solve import BEAMS, LatticeSolver
from planners.search.beam import BEAM
from planners.search.problem import Problem
from srs_opt.files import write_json
from srs_opt.gait_opt.catalogue import default_table
from srs_opt.gait_opt.companions import duty_biased_family, wave_family
from srs_opt.gait_opt.table import GaitTable, load_table
from srs_opt.robot import Robot, wpi_srs

MARGIN_M = 0.005
# frequency Hz, pressure kPa, lag rad: from slim to strong
GRID = ((2.0, 26.0, 1.0), (2.0, 30.0, 0.9), (2.0, 40.0, 0.9), (2.0, 48.0, 0.9), (2.0, 55.0, 0.9))
QUICK_GRID = GRID[2:3]
OURS = ("first", "u_turn", "slalom", "rooms", "narrow", "blocks", "door 72", "door 66", "door 60")
MAZES = (*OURS, *(f"cells {seed}" for seed in range(8)))
OWN = "its own"
STRAIGHT_RAD_S = 0.02
LIMIT_NODES, LIMIT_S = 6000, 60.0

TableMotion = tuple[GaitTable, MotionTable]


def own_family(robot: Robot, table: GaitTable) -> GaitTable:
    """Return the family of the table's fastest straight gait."""
    straight = [e for e in table.gaits if abs(e.turn_rate_rad_s) < STRAIGHT_RAD_S]
    return duty_biased_family(robot, max(straight, key=lambda e: e.speed_m_s).gait)


def maze_named(name: str, size: RobotSize) -> Maze:
    """Return one of our mazes, a door so many mm wide in a hall, or a contest maze at 0.27 m."""
    kind, _, number = name.partition(" ")
    if kind == "door":
        room_m = 1e-3 * float(number) + 2 * MARGIN_M
        return corridor(0.4, room_m, 0.4, random.Random(1), size)
    if kind == "cells":
        return contest_maze(int(number), 0.27, size)
    return load_maze(f"mazes/{name}.yaml")


def duration(robot: Robot, run: TableMotion, maze: Maze, width: int | None) -> float | None:
    """Return the traverse time of the first certified plan, s; None without one."""
    problem = Problem(robot, *run, maze, MARGIN_M)
    beams = BEAMS if width is None else (replace(BEAM, width=width),)
    plan = LatticeSolver(problem, beams=beams, time_limit_s=LIMIT_S).run(LIMIT_NODES).plan
    return plan.duration_s if plan else None


def compare(
    table: GaitTable, grid: tuple[tuple[float, float, float], ...], names: tuple[str, ...], width: int | None
) -> list[dict[str, float | None]]:
    """Return the times of the table and of each family, maze by maze."""
    robot = wpi_srs()
    tables = {"whole table": table, OWN: own_family(robot, table)}
    tables |= {f"{p:g} kPa, {f:g} Hz, {lag:g} rad": wave_family(robot, f, p, lag) for f, p, lag in grid}
    runs = {name: (gaits, load_motion(robot, gaits)) for name, gaits in tables.items()}
    size = RobotSize(robot.length_m, robot.body_width_m / 2, MARGIN_M)
    rows = []
    for name in names:
        maze = maze_named(name, size)
        rows.append({run: duration(robot, runs[run], maze, width) for run in runs})
        print(name, rows[-1], file=sys.stderr, flush=True)
    return rows


def shorter(ours: list[float | None], others: list[float | None]) -> float:
    """Return by what share our times are shorter, in the median over mazes that both do."""
    ratios = [a / b for a, b in _both(ours, others)]
    return 1 - float(np.median(ratios)) if ratios else float("nan")


def shorter_together(ours: list[float | None], others: list[float | None]) -> float:
    """Return by what share the mazes that both do take us less time in all."""
    both = _both(ours, others)
    return 1 - sum(a for a, _ in both) / sum(b for _, b in both) if both else float("nan")


def _both(ours: list[float | None], others: list[float | None]) -> list[tuple[float, float]]:
    return [(a, b) for a, b in zip(ours, others) if a is not None and b is not None]


def section(
    table: GaitTable, grid: tuple[tuple[float, float, float], ...], names: tuple[str, ...], width: int | None
) -> Section:
    """Return the comparison as a table."""
    rows = compare(table, grid, names, width)
    families = [run for run in rows[0] if run != "whole table"]
    ours = [row["whole table"] for row in rows]
    own = [row[OWN] for row in rows]
    best = [min((row[f] for f in families if row[f] is not None), default=None) for row in rows]
    cells = [
        [name, *(_seconds(t) for t in (ours[k], *(row[f] for f in families)))]
        for k, (name, row) in enumerate(zip(names, rows))
    ]
    alone = sum(a is not None and b is None for a, b in zip(ours, best))
    notes = [
        f"Shorter in the median, {OWN} family | the best of {len(families)} in hindsight: "
        + "; ".join(
            f"{kind} {100 * shorter(*_only(chosen, ours, own)):.0f} % | "
            f"{100 * shorter(*_only(chosen, ours, best)):.0f} %"
            for kind, chosen in _groups(names)
        )
        + f". All that {OWN} family does together: {100 * shorter_together(ours, own):.0f} % shorter. "
        f"In {alone} of {len(rows)} mazes every family fails and the table does not."
    ]
    columns = ["maze", "whole table, s", *(f"{name}, s" for name in families)]
    return Section(
        "Planner: traverse time", columns, cells, notes,
        {"traverse time to one family's": 1 - shorter(ours, own)},
    )  # fmt: skip


def _groups(names: tuple[str, ...]) -> list[tuple[str, list[bool]]]:
    """Return the kinds of mazes, and which mazes are of each."""
    contest = [name.startswith("cells") for name in names]
    kinds = [("all", [True] * len(names)), ("rooms and doors", [not c for c in contest])]
    return [*kinds, ("contest-like mazes", contest)]


def _only(chosen: list[bool], *lists: list[float | None]) -> list[list[float | None]]:
    return [[value for value, keep in zip(values, chosen) if keep] for values in lists]


def _seconds(value: float | None) -> str:
    return "none" if value is None else f"{value:.1f}"


def run(quick: bool) -> Section:
    """Compare, for the report of all benchmarks."""
    table = default_table(wpi_srs())
    if quick:
        return section(table, QUICK_GRID, ("first",), None)
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

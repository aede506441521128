"""Contest-like mazes of 16 x 16 cells: solved, certified, driven; time to the first certified plan.

python -m benchmarks.planner_mazes [--cell 0.36 0.27 0.18] [--count 40] [--no-drive] [--gaits FILE]
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.section import Section
from planners.drive.execute import execute
from planners.generate.passages import braided, perfect
from planners.maze.maze import Maze
from planners.maze.micromouse import read_micromouse
from planners.maze.places import RobotSize
from planners.motion.store import load_motion
from planners.motion.table import MotionTable
from planners.plan.explain import explain
from planners.plan.solve import solve_with_lattice
from planners.search.problem import Problem
from srs_opt.files import write_json
from srs_opt.gait_opt.table import GaitTable, load_table
from srs_opt.robot import Robot, wpi_srs

SIZE = 16


@dataclass(frozen=True)
class Row:
    """One maze."""

    name: str
    cell_m: float
    status: str
    planning_s: float
    cpu_s: float
    length_m: float | None = None
    duration_s: float | None = None
    clearance_m: float | None = None
    cycles: int | None = None
    simulated: int | None = None
    certificates: int | None = None
    reached: bool | None = None
    collisions: int | None = None
    drive_clearance_m: float | None = None
    drive_s: float | None = None
    reason: str | None = None


def contest_maze(seed: int, cell_m: float, size: RobotSize) -> Maze:
    """Return maze `seed` of the suite: perfect and braided, depth-first and Wilson's, in turn."""
    rng = random.Random(seed)
    method = "wilson" if seed % 4 >= 2 else "depth-first"
    cells = braided(SIZE, rng, 0.5, method) if seed % 2 else perfect(SIZE, rng, method)
    kind = "braided" if seed % 2 else "perfect"
    maze = read_micromouse(cells.to_text(), f"{kind} {method} {seed}", cell_m, size)
    return replace(maze, name=f"{kind} {method} {seed}")


def one(robot: Robot, gaits: GaitTable, motion: MotionTable, maze: Maze, cell_m: float, drive: bool) -> Row:
    """Plan through one maze, and drive it."""
    problem = Problem(robot, gaits, motion, maze, 0.005)
    began, cpu = time.perf_counter(), time.process_time()
    result = solve_with_lattice(problem, time_limit_s=600.0, max_nodes=40_000)  # nodes end it, not the clock
    planning, cpu = time.perf_counter() - began, time.process_time() - cpu
    if result.plan is None:
        why = explain(problem).in_words(result.reason)
        return Row(maze.name, cell_m, result.status, planning, cpu, reason=why, **_effort(result.effort))
    plan = result.plan
    row = Row(
        maze.name,
        cell_m,
        result.status,
        planning,
        cpu,
        plan.length_m,
        plan.duration_s,
        plan.certificate.clearance_m,
        len(plan.gaits),
        **_effort(result.effort),
    )
    if not drive:
        return row
    driven = execute(problem, plan)
    return replace(
        row,
        reached=driven.reached,
        collisions=driven.collisions,
        drive_clearance_m=driven.smallest_clearance_m,
        drive_s=driven.duration_s,
        reason=None if driven.reached else driven.reason,
    )


def _effort(effort: dict[str, int]) -> dict[str, int]:
    return {key: effort[key] for key in ("simulated", "certificates")}


def report(rows: list[Row], cell_m: float) -> str:
    """Return one line for a cell size."""
    mine = [r for r in rows if r.cell_m == cell_m]
    solved = [r for r in mine if r.status == "solved"]
    clean = [r for r in solved if r.reached and not r.collisions]
    times, cpu = [r.planning_s for r in mine], [r.cpu_s for r in mine]
    return (
        f"{cell_m:5.2f} m  solved {len(solved):2d}/{len(mine)}"
        f"  driven without contact {len(clean):2d}/{len(solved)}"
        f"  planning median {np.median(times):5.2f} s, 90 % {np.quantile(times, 0.9):5.2f} s"
        f" (CPU {np.median(cpu):5.2f}, {np.quantile(cpu, 0.9):5.2f} s)"
        + (
            f"  length {np.median([r.length_m for r in solved]):5.1f} m"
            f"  duration {np.median([r.duration_s for r in solved]):5.1f} s"
            f"  clearance {1e3 * min(r.clearance_m for r in solved):.1f} mm"
            if solved
            else ""
        )
    )


def run(quick: bool) -> Section:
    """Return the report of a few mazes per cell size; `main` runs many."""
    from srs_opt.gait_opt.catalogue import default_table

    robot = wpi_srs()
    gaits = default_table(robot)
    motion = load_motion(robot, gaits)
    size = RobotSize(robot.length_m, robot.body_width_m / 2, 0.005)
    lines = []
    for cell_m in (0.36,) if quick else (0.36, 0.27, 0.18):
        mazes = [contest_maze(seed, cell_m, size) for seed in range(1 if quick else 6)]
        lines.append(_line([one(robot, gaits, motion, maze, cell_m, drive=not quick) for maze in mazes]))
    columns = ["cell (m)", "solved", "driven without contact", "planning (processor s), median and most",
               "length (m)", "duration (s)", "least clearance (mm)"]  # fmt: skip
    notes = [
        "Generated mazes of 16 x 16 cells, perfect and braided in turn; lengths and durations are medians."
    ]
    return Section("Contest-like mazes", columns, lines, notes)


def _line(rows: list[Row]) -> list[str]:
    solved = [r for r in rows if r.status == "solved"]
    clean = [r for r in solved if r.reached and not r.collisions]
    driven = [r for r in solved if r.reached is not None]
    times = [r.cpu_s for r in rows]
    found = ["-", "-", "-"]
    if solved:
        found = [
            f"{np.median([r.length_m for r in solved]):.1f}",
            f"{np.median([r.duration_s for r in solved]):.1f}",
            f"{1e3 * min(r.clearance_m for r in solved if r.clearance_m is not None):.1f}",
        ]
    return [
        f"{rows[0].cell_m:g}",
        f"{len(solved)} of {len(rows)}",
        f"{len(clean)} of {len(driven)}" if driven else "-",
        f"{np.median(times):.2f}, {max(times):.2f}",
        *found,
    ]


def main() -> None:
    """Run the suite and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cell", type=float, nargs="+", default=[0.36, 0.27, 0.18])
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--no-drive", action="store_true")
    parser.add_argument("--gaits", type=Path)
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks/planner_mazes.json"))
    options = parser.parse_args()
    import scipy.ndimage
    import scipy.sparse.csgraph  # noqa: F401  (not part of the time)

    robot = wpi_srs()
    if options.gaits:
        gaits = load_table(options.gaits, robot)
    else:
        from srs_opt.gait_opt.catalogue import default_table

        gaits = default_table(robot)
    motion = load_motion(robot, gaits)
    size = RobotSize(robot.length_m, robot.body_width_m / 2, 0.005)
    rows = []
    for cell_m in options.cell:
        for seed in range(options.first, options.first + options.count):
            row = one(
                robot, gaits, motion, contest_maze(seed, cell_m, size), cell_m, drive=not options.no_drive
            )
            rows.append(row)
            print(row, file=sys.stderr, flush=True)
        print(report(rows, cell_m), flush=True)
    write_json(options.out, [asdict(row) for row in rows])


if __name__ == "__main__":
    main()

"""Contest-like mazes of 16 x 16 cells: solved, certified, driven; time to the first certified plan.

    python -m benchmarks.planner_mazes --sets 40 --jobs 2 [--cell 0.36 0.27 0.18] [--no-drive] [--gaits FILE]

Times are processor times, each of one maze, so that it does not matter how many are planned side by side.
"""

from __future__ import annotations

import hashlib
import random
import sys
import time
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser
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
from srs_opt.gait_opt.catalogue import default_table
from srs_opt.gait_opt.table import GaitTable, load_table
from srs_opt.robot import Robot, wpi_srs

NAME = "planner_mazes"
SIZE = 16
MARGIN_M = 0.005
CELLS_M = (0.36, 0.27, 0.18)
NODES, LIMIT_S = 40_000, 600.0  # nodes end a search, not the clock


@dataclass(frozen=True)
class Row:
    """One maze."""

    name: str
    cell_m: float
    status: str
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


@lru_cache(maxsize=1)
def setting(gaits_file: str | None = None) -> tuple[Robot, GaitTable, MotionTable, RobotSize]:
    """Return robot, gaits, motion and the robot's size; once per process, with all code loaded."""
    robot = wpi_srs()
    gaits = load_table(Path(gaits_file), robot) if gaits_file else default_table(robot)
    motion = load_motion(robot, gaits)
    size = RobotSize(robot.length_m, robot.body_width_m / 2, MARGIN_M)
    small = read_micromouse(perfect(4, random.Random(0)).to_text(), "small", 0.36, size)
    # what is loaded and compiled at the first plan is nobody's planning time
    solve_with_lattice(Problem(robot, gaits, motion, small, MARGIN_M), time_limit_s=LIMIT_S, max_nodes=NODES)
    return robot, gaits, motion, size


def attempt(cell_m: float, seed: int, drive: bool, gaits_file: str | None = None) -> dict[str, Any]:
    """Plan through one maze, and drive it; return its `Row` as JSON holds it."""
    robot, gaits, motion, size = setting(gaits_file)
    maze = contest_maze(seed, cell_m, size)
    return asdict(one(Problem(robot, gaits, motion, maze, MARGIN_M), cell_m, drive))


def one(problem: Problem, cell_m: float, drive: bool) -> Row:
    """Plan through one maze, and drive it."""
    name, cpu = problem.maze.name, time.process_time()
    result = solve_with_lattice(problem, time_limit_s=LIMIT_S, max_nodes=NODES)
    cpu = time.process_time() - cpu
    if result.plan is None:
        why = explain(problem).in_words(result.reason)
        return Row(name, cell_m, result.status, cpu, reason=why, **_effort(result.effort))
    plan = result.plan
    row = Row(
        name,
        cell_m,
        result.status,
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


def section(rows: list[Row], when: str) -> Section:
    """Return a line per cell size, largest first."""
    cells = sorted({row.cell_m for row in rows}, reverse=True)
    columns = ["cell (m)", "solved", "driven without contact",
               "planning (processor s): median, 9 of 10, most", "length (m)", "duration (s)",
               "least clearance (mm)"]  # fmt: skip
    lines = [_line([row for row in rows if row.cell_m == cell_m]) for cell_m in cells]
    notes = [
        "Generated mazes of 16 x 16 cells, perfect and braided in turn; lengths and durations are medians. "
        f"{when}"
    ]
    return Section("Planner: contest-like mazes", columns, lines, notes)


def _line(rows: list[Row]) -> list[str]:
    solved = [r for r in rows if r.status == "solved"]
    driven = [r for r in solved if r.reached is not None]
    clean = [r for r in driven if r.reached and not r.collisions]
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
        f"{np.median(times):.2f}, {np.quantile(times, 0.9):.2f}, {max(times):.2f}",
        *found,
    ]


def run(quick: bool) -> Section:
    """Return the stored study; one maze, planned only, if quick or where there is none."""
    stored = None if quick else stored_rows(NAME)
    if stored is None:
        return section([Row(**attempt(CELLS_M[0], 0, drive=False))], "One maze only.")
    when, rows = stored
    return section([Row(**row) for row in rows], f"Measured {when}.")


def main() -> None:
    """Run the suite and print the table."""
    parser = study_parser(NAME, __doc__, sets=40)
    add = parser.add_argument
    add("--cell", type=float, nargs="+", default=list(CELLS_M), metavar="M",
        help="sizes of the cells, m (default: 0.36 0.27 0.18)")  # fmt: skip
    add("--no-drive", action="store_true", help="plan only")
    add("--gaits", type=Path, metavar="FILE", help="gait table (default: the shipped one)")
    options = parser.parse_args()
    seeds = range(options.seed - 1, options.seed - 1 + options.sets)
    file = str(options.gaits.resolve()) if options.gaits else None
    items = [(cell_m, seed, not options.no_drive, file) for cell_m in options.cell for seed in seeds]
    depends = hashlib.sha256(options.gaits.read_bytes()).hexdigest() if options.gaits else ""
    rows = [Row(**row) for row in gather(NAME, attempt, items, options, depends)]
    for row in rows:
        if row.reason:
            print(f"{row.name}, {row.cell_m:g} m: {row.reason}", file=sys.stderr)
    print(section(rows, "").markdown())


if __name__ == "__main__":
    main()

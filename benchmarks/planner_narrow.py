"""Narrow passages: success against width, beside OMPL's planners alone with the same body and model.

python -m benchmarks.planner_narrow [--ratios 1.05 1.15 1.3 1.6 2.0] [--sets 2] [--jobs 2]

Widths are multiples of what the table's slimmest straight gait sweeps, with the margin on either side.
Ours is the beam and the two best-first searches of the portfolio, without OMPL's planners. Every planner's
way passes the same certificate before it counts.
"""

from __future__ import annotations

import random
import time
from functools import lru_cache

from benchmarks.section import Section
from benchmarks.stored import Row, gather, stored_rows, study_parser
from planners.generate.areas import corridor
from planners.maze.places import RobotSize
from planners.motion.store import load_motion
from planners.motion.table import MotionTable
from planners.plan.certify import certify
from planners.plan.portfolio import found_apart
from planners.plan.registry import planner_named
from planners.plan.solve import LatticeSolver
from planners.search.problem import Problem
from srs_opt.gait_opt.catalogue import default_table
from srs_opt.gait_opt.table import GaitTable
from srs_opt.robot import Robot, wpi_srs

NAME = "planner_narrow"
MARGIN_M = 0.001
RATIOS = (1.05, 1.15, 1.3, 1.6, 2.0)
RIVALS = ("dubins-bitstar", "dubins-rrtconnect", "rrt", "est", "kpiece")
PLANNERS = ("ours", *RIVALS)
NODES, ITERATIONS = 5000, 1000
LIMIT_S = 600.0  # a guard; nodes and iterations end the work


@lru_cache(maxsize=1)
def setting() -> tuple[Robot, GaitTable, MotionTable, float]:
    """Return robot, gaits, motion and the slimmest straight gait's band, m; once per process."""
    robot = wpi_srs()
    gaits = default_table(robot)
    slimmest = min(sum(e.envelope_m) for e in gaits.gaits if e.radius_m is None)
    return robot, gaits, load_motion(robot, gaits), slimmest


def attempt(ratio: float, planner: str, seed: int) -> Row:
    """Return whether a planner finds a plan that passes the certificate, and its processor time."""
    robot, gaits, motion, slimmest = setting()
    size = RobotSize(robot.length_m, robot.body_width_m / 2, MARGIN_M)
    maze = corridor(0.3, ratio * slimmest + 2 * MARGIN_M, 0.5, random.Random(seed), size)
    problem = Problem(robot, gaits, motion, maze, MARGIN_M)
    cpu = time.process_time()
    if planner == "ours":
        solved = _ours(problem)
    else:
        way = found_apart(problem, planner, ITERATIONS, seed)
        solved = way is not None and certify(problem, way).passed
    return {
        "ratio": ratio,
        "planner": planner,
        "seed": seed,
        "solved": solved,
        "cpu_s": time.process_time() - cpu,
    }


def _ours(problem: Problem) -> bool:
    first = LatticeSolver(problem, time_limit_s=LIMIT_S).run(NODES)
    if first.plan is not None or first.status == "infeasible":
        return first.plan is not None
    make = planner_named("fine").solver
    assert make is not None  # it is one of ours
    return make(problem, time_limit_s=LIMIT_S).run(NODES).plan is not None


def section(rows: list[Row], when: str) -> Section:
    """Return success against width as a table."""
    ratios = sorted({row["ratio"] for row in rows})
    planners = [planner for planner in PLANNERS if any(row["planner"] == planner for row in rows)]
    cells = []
    for ratio in ratios:
        line = [f"{ratio:.2f}"]
        for planner in planners:
            mine = [row for row in rows if row["ratio"] == ratio and row["planner"] == planner]
            cpu = sum(row["cpu_s"] for row in mine) / max(len(mine), 1)
            line.append(f"{sum(row['solved'] for row in mine)}/{len(mine)} ({cpu:.1f} s)")
        cells.append(line)
    notes = [
        "Solved and certified, and processor time each. Width over the band of the slimmest straight gait, "
        f"margins of {1e3 * MARGIN_M:g} mm besides; OMPL's planners get {ITERATIONS} iterations. {when}"
    ]
    return Section("Planner: narrow passages", ["width", *planners], cells, notes)


def run(quick: bool) -> Section:
    """Return the stored study; two quick attempts where there is none."""
    stored = None if quick else stored_rows(NAME)
    if stored is None:
        return section([attempt(2.0, planner, 0) for planner in ("ours", "dubins-bitstar")], "Quick.")
    when, rows = stored
    return section(rows, when)


def main() -> None:
    """Run the suite and print the table."""
    parser = study_parser(NAME, __doc__, sets=2)
    parser.add_argument("--ratios", type=float, nargs="+", default=list(RATIOS))
    options = parser.parse_args()
    items = [
        (ratio, planner, options.seed - 1 + k)
        for ratio in options.ratios
        for planner in PLANNERS
        for k in range(options.sets)
    ]
    print(section(gather(NAME, attempt, items, options), "").markdown())


if __name__ == "__main__":
    main()

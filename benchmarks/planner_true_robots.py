"""Plans driven by robots that differ from the planned one: do they arrive, do they touch, how late are they?

    python -m benchmarks.planner_true_robots --sets 20 --jobs 2

Contest-like mazes of 16 x 16 cells of 0.36 m, planned for the built-in robot. The true robots have a fifth
less or more friction, drag a hose of 35 mN along, or have a segment that always bends.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.planner_mazes import CELLS_M, LIMIT_S, MARGIN_M, NODES, contest_maze, setting
from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser
from planners.drive.execute import Execution, execute
from planners.motion.robots import with_friction_times
from planners.plan.answer import Plan
from planners.plan.solve import solve_with_lattice
from planners.search.problem import Problem
from srs_opt.robot import Robot

NAME = "planner_true_robots"
Row = dict[str, Any]


def _with_effect(**effect: Any) -> Callable[[Robot], Robot]:
    return lambda planned: planned.with_values(effects=[effect])


# what makes the robot that drives of the planned one
TRUE: dict[str, Callable[[Robot], Robot]] = {
    "as planned": lambda planned: planned,
    "friction 20 % less": lambda planned: with_friction_times(planned, 0.8, 0.8),
    "friction 20 % more": lambda planned: with_friction_times(planned, 1.2, 1.2),
    "a hose of 35 mN": _with_effect(name="tether_drag", force_n=0.035),
    "segment 2 bent by 1/m": _with_effect(name="segment_bias", bias=1.0, segment=2),
}


def attempt(kind: str, seed: int) -> Row:
    """Plan through one maze for the robot as we know it, drive as it is."""
    robot, gaits, motion, size = setting()
    problem = Problem(robot, gaits, motion, contest_maze(seed, CELLS_M[0], size), MARGIN_M)
    plan = solve_with_lattice(problem, time_limit_s=LIMIT_S, max_nodes=NODES).plan
    if plan is None:
        return {"robot": kind, "maze": problem.maze.name, "planned": False}
    driven = execute(problem, plan, TRUE[kind](robot))
    return {
        "robot": kind,
        "maze": problem.maze.name,
        "planned": True,
        **drive_row(plan, driven),
    }


def drive_row(plan: Plan, driven: Execution) -> Row:
    """Return what a row says of a drive."""
    return {
        "plan_s": plan.duration_s,
        "drive_s": driven.duration_s,
        "reached": driven.reached,
        "collisions": driven.collisions,
        "clearance_m": driven.smallest_clearance_m,
        "replans": driven.replans,
        "reason": driven.reason,
    }


def section(rows: list[Row], when: str) -> Section:
    """Return a line per robot."""
    columns = ["true robot", "arrived", "stopped and said so", "touched", "least clearance (mm)",
               "time over the plan's: median, most", "replans: mean"]  # fmt: skip
    kinds = [kind for kind in TRUE if any(row["robot"] == kind for row in rows)]
    lines = [_line(kind, [r for r in rows if r["robot"] == kind and r["planned"]]) for kind in kinds]
    unplanned = sum(not row["planned"] for row in rows)
    notes = [f"Mazes of 0.36 m cells, margin 5 mm; {unplanned} without a plan left out. {when}"]
    return Section("Planner: driven by robots that differ from the planned one", columns, lines, notes)


def _line(kind: str, rows: list[Row]) -> list[str]:
    arrived = [r for r in rows if r["reached"]]
    touched = [r for r in rows if r["collisions"]]
    late = [r["drive_s"] / r["plan_s"] for r in arrived] or [float("nan")]
    return [
        kind,
        f"{len(arrived)} of {len(rows)}",
        str(len(rows) - len(arrived) - len(touched)),
        str(len(touched)),
        f"{1e3 * min(r['clearance_m'] for r in rows):.1f}",
        f"{np.median(late):.2f}, {max(late):.2f}",
        f"{np.mean([r['replans'] for r in rows]):.1f}",
    ]


def run(quick: bool) -> Section:
    """Return the stored study; one maze and robot if quick or where there is none."""
    stored = None if quick else stored_rows(NAME)
    if stored is None:
        return section([attempt("friction 20 % less", 1)], "One maze only.")
    when, rows = stored
    return section(rows, f"Measured {when}.")


def main() -> None:
    """Run the study and print the table."""
    options = study_parser(NAME, __doc__, sets=20).parse_args()
    seeds = range(options.seed - 1, options.seed - 1 + options.sets)
    items = [(kind, seed) for kind in TRUE for seed in seeds]
    print(section(gather(NAME, attempt, items, options), "").markdown())


if __name__ == "__main__":
    main()

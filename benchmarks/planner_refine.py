"""Traverse mazes with plans as found and refined: time before and after, processor time.

    python -m benchmarks.planner_refine [--mazes NAME ...] [--jobs 2]

All plans are certified before and after, and the refined ones driven closed-loop.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from benchmarks.planner_mazes import LIMIT_S, MARGIN_M, NODES, setting
from benchmarks.planner_traverse import MAZES, maze_named
from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser
from planners.drive.execute import execute
from planners.plan.solve import solve_with_lattice
from planners.refine.refine import refine
from planners.search.problem import Problem

NAME = "planner_refine"


@dataclass(frozen=True)
class Row:
    """One maze."""

    maze: str
    found_s: float | None
    refined_s: float | None = None
    seconds: float | None = None
    kept: str | None = None
    clearance_m: float | None = None
    reached: bool | None = None
    replans: int | None = None


def attempt(name: str) -> dict[str, Any]:
    """Plan, refine and drive; return the `Row` as JSON holds it."""
    robot, gaits, motion, size = setting()
    problem = Problem(robot, gaits, motion, maze_named(name, size), MARGIN_M)
    plan = solve_with_lattice(problem, time_limit_s=LIMIT_S, max_nodes=NODES).plan
    if plan is None:
        return asdict(Row(name, None))
    made = refine(problem, plan)
    driven = execute(made.problem, made.plan)
    clearance = made.plan.certificate.clearance_m
    kept = made.reason or None
    after = made.plan.duration_s
    row = Row(name, plan.duration_s, after, made.seconds, kept, clearance, driven.reached, driven.replans)
    return asdict(row)


def section(rows: list[Row], when: str) -> Section:
    """Return the study as a table."""
    done = [row for row in rows if row.found_s is not None]
    less = [1 - (row.refined_s or 0.0) / (row.found_s or 1.0) for row in done]
    effort = [(row.seconds or 0.0) / (row.found_s or 1.0) for row in done]
    cells = [
        [
            row.maze,
            f"{row.found_s:.2f}",
            f"{row.refined_s:.2f}" if not row.kept else f"kept: {row.kept}",
            f"{100 * share:.1f}",
            f"{work:.1f}",
            f"{1e3 * (row.clearance_m or 0.0):.1f}",
            f"{'arrived' if row.reached else 'not arrived'}, {row.replans} replans",
        ]
        for row, share, work in zip(done, less, effort)
    ]
    columns = ["maze", "as found (s)", "refined (s)", "less (%)", "processor s per s of plan",
               "least clearance (mm)", "driven"]  # fmt: skip
    gained, cost = 100 * float(np.median(less)), float(np.median(effort))
    notes = [
        f"{len(done)} of the {len(MAZES)} traverse mazes. Median {gained:.1f} % less time for {cost:.1f} s "
        f"of processor time per second of plan (most {max(effort):.1f}). {when}"
    ]
    return Section("Planner: plans refined", columns, cells, notes)


def run(quick: bool) -> Section:
    """Return the stored study, quick or not; one short maze where there is none."""
    stored = stored_rows(NAME)
    if stored is None:
        return section([Row(**attempt("door 72"))], "One maze only.")
    when, rows = stored
    return section([Row(**row) for row in rows], f"Measured {when}.")


def main() -> None:
    """Run the study and print the table."""
    parser = study_parser(NAME, __doc__, sets=len(MAZES))
    parser.add_argument("--mazes", nargs="+", default=None, help="names, 'door MM' or 'cells SEED'")
    options = parser.parse_args()
    names = options.mazes or list(MAZES)[: options.sets]
    rows = [Row(**row) for row in gather(NAME, attempt, [(name,) for name in names], options)]
    print(section(rows, "").markdown())


if __name__ == "__main__":
    main()

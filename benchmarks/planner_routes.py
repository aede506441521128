"""Which planner answers best: the lattice, or gaits that follow a route of OMPL's geometric planners.

    python -m benchmarks.planner_routes [--jobs 2]

A route is a curve for the differential drive (Dubins or Reeds-Shepp, the tightest radius of the table, the
band that a gait sweeps); the gaits follow it on the dynamic model. All are judged by the same certificate.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from benchmarks.planner_mazes import LIMIT_S, MARGIN_M, NODES, setting
from benchmarks.planner_traverse import maze_named
from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser
from planners.plan.certify import certify
from planners.plan.registry import Effort, planner_named
from planners.plan.solve import solve_with_lattice
from planners.search.problem import Problem

NAME = "planner_routes"
MAZES = ("first", "u_turn", "slalom", "rooms", "narrow", "blocks", "door 72", "cells 1", "cells 3", "cells 6",
         "cells 7")  # fmt: skip
ROUTES = ("dubins-rrtconnect", "rs-rrtconnect", "dubins-bitstar")
ITERATIONS, ROUNDS = 1000, 3  # twice as many every round, with a fresh seed


@dataclass(frozen=True)
class Row:
    """One maze and planner; times are processor times, to the first certified plan or to giving up."""

    maze: str
    planner: str
    seconds: float
    duration_s: float | None


def attempt(name: str, planner: str) -> dict[str, Any]:
    """Plan through one maze with one planner; return the `Row` as JSON holds it."""
    robot, gaits, motion, size = setting()
    problem = Problem(robot, gaits, motion, maze_named(name, size), MARGIN_M)
    began = time.process_time()
    if planner == "lattice":
        plan = solve_with_lattice(problem, time_limit_s=LIMIT_S, max_nodes=NODES).plan
        return asdict(Row(name, planner, time.process_time() - began, plan and plan.duration_s))
    for turn in range(ROUNDS):
        effort = Effort(ITERATIONS * 2**turn, turn, lambda: False)
        way = planner_named(planner).find(problem, effort)
        certificate = None if way is None else certify(problem, way)
        if certificate is not None and certificate.passed:
            duration_s = float(certificate.time_s[-1])
            return asdict(Row(name, planner, time.process_time() - began, duration_s))
    return asdict(Row(name, planner, time.process_time() - began, None))


def section(rows: list[Row], when: str) -> Section:
    """Return a line per maze."""
    planners = list(dict.fromkeys(row.planner for row in rows))
    mazes = list(dict.fromkeys(row.maze for row in rows))
    by = {(row.maze, row.planner): row for row in rows}
    lines = [[maze, *(_told(by.get((maze, planner))) for planner in planners)] for maze in mazes]
    notes = [_compared([by[maze, planner] for maze in mazes], [by[maze, "lattice"] for maze in mazes])
             for planner in planners if planner != "lattice"]  # fmt: skip
    return Section("Planner: lattice and routes of OMPL's", ["maze", *planners], lines, [*notes, when])


def _told(row: Row | None) -> str:
    if row is None:
        return "-"
    found = "none" if row.duration_s is None else f"{row.duration_s:.1f} s"
    return f"{found} ({row.seconds:.1f} s)"


def _compared(routes: list[Row], lattice: list[Row]) -> str:
    both = [(a, b) for a, b in zip(routes, lattice) if a.duration_s and b.duration_s]
    sooner = sum(a.seconds < b.seconds for a, b in both)
    alone = sum(bool(a.duration_s) and not b.duration_s for a, b in zip(routes, lattice))
    longer = [(a.duration_s or 0.0) / (b.duration_s or 1.0) for a, b in both]
    times = f"{float(np.median(longer)):.2f} times as long in the median" if longer else "none to compare"
    return (
        f"{routes[0].planner}: certified in {sum(a.duration_s is not None for a in routes)} of "
        f"{len(routes)}, "
        f"found sooner in {sooner}, where the lattice finds nothing in {alone}; plans {times}."
    )


def run(quick: bool) -> Section:
    """Return the stored study; one maze and route if quick or where there is none."""
    stored = None if quick else stored_rows(NAME)
    if stored is None:
        rows = [Row(**attempt("slalom", planner)) for planner in ("lattice", ROUTES[0])]
        return section(rows, "One maze only.")
    when, rows = stored
    return section([Row(**row) for row in rows], f"Way's duration (processor time). Measured {when}.")


def main() -> None:
    """Run the study and print the table."""
    parser = study_parser(NAME, __doc__, sets=len(MAZES))
    options = parser.parse_args()
    items = [(maze, planner) for maze in MAZES[: options.sets] for planner in ("lattice", *ROUTES)]
    rows = [Row(**row) for row in gather(NAME, attempt, items, options)]
    print(section(rows, "").markdown())


if __name__ == "__main__":
    main()

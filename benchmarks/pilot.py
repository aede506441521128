"""Contest mazes piloted: C firmware, valve line, camera with noise and latency, the virtual snake.

    python -m benchmarks.pilot --sets 20 --jobs 2 [--cell 0.36]

The snake, its firmware and its camera share no code with the models that plan and predict.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.planner_mazes import contest_maze, setting
from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser
from planners.pilot.pose import Report, parse_report
from planners.pilot.session import PilotedDrive, pilot
from planners.plan.answer import Plan
from planners.plan.certify import clearances
from planners.plan.solve import solve_with_lattice
from planners.search.problem import Problem
from srs_opt.controller.c_source import write_program
from srs_opt.controller.program import Program
from srs_opt.geometry import points_in_room
from srs_opt.simulate.shapes import centre_lines
from virtual_lab.truth import Truth
from virtual_lab.world import DEFAULT, Imperfections, World

NAME = "pilot"
TICK_S = 1e-3
MARGIN_M = 0.005


@dataclass(frozen=True)
class Arena:
    """A maze, a plan through it, and the program that the controller holds."""

    problem: Problem
    plan: Plan
    program: Program


def contest(seed: int, cell_m: float) -> Arena:
    """Return maze `seed` of the contest suite with its plan."""
    robot, gaits, motion, size = setting()
    problem = Problem(robot, gaits, motion, contest_maze(seed, cell_m, size), MARGIN_M)
    result = solve_with_lattice(problem, time_limit_s=600.0, max_nodes=40_000)
    assert result.plan is not None  # the planner's own study looks at that
    return Arena(problem, result.plan, Program.of_table(gaits, TICK_S))


class _WorldPoses:
    """The virtual camera's lines as a pose source."""

    def __init__(self, world: World, links: int) -> None:
        self._world, self._links = world, links

    def poll(self) -> list[Report]:
        return [parse_report(line, self._world.now(), self._links) for line in self._world.pictures()]

    def close(self) -> None:
        pass


@dataclass
class VirtualPilot:
    """A pilot's session with the virtual snake."""

    arena: Arena
    world: World
    messages: list[str] = field(default_factory=list)

    def run(self, watch: Callable[[Any], None] = lambda plant: None) -> PilotedDrive:
        """Drive."""
        poses = _WorldPoses(self.world, self.arena.problem.robot.links)
        self.world.sleep(0.4)  # the camera has been running for a while
        a = self.arena
        return pilot(a.problem, a.plan, a.program, self.world, poses, self.world, self.messages.append, watch)

    def true_clearance_m(self) -> float:
        """Return the least clearance of the virtual snake's body so far."""
        track, problem = self.world.track, self.arena.problem
        pose = np.array([[*places.mean(axis=0), heading.mean()] for _, places, heading, _ in track])
        kappa = np.array([kappa for *_, kappa in track])
        return float(clearances(problem, points_in_room(centre_lines(problem.integrator, kappa), pose)).min())


def virtual_pilot(
    arena: Arena,
    truth: Truth | None = None,
    seed: int = 0,
    start: tuple[float, float, float] | None = None,
    imperfections: Imperfections = DEFAULT,
) -> VirtualPilot:
    """Return a session with a virtual snake that lies at the start (or elsewhere)."""
    pose = arena.problem.start
    with tempfile.TemporaryDirectory() as folder:
        header = write_program(arena.program, Path(folder) / "program.h")
        where = start or (pose.x, pose.y, pose.heading)
        return VirtualPilot(arena, World(truth or Truth(), header, where, seed, imperfections))


def drive_contest(seed: int, cell_m: float, truth: Truth | None = None) -> dict[str, Any]:
    """Pilot one maze; return its row."""
    cpu = time.process_time()
    arena = contest(seed, cell_m)
    session = virtual_pilot(arena, truth, seed)
    driven = session.run()
    session.world.sleep(1.5)  # what rolls out counts too
    e, true_m = driven.execution, session.true_clearance_m()
    return {
        "seed": seed,
        "cell_m": cell_m,
        "reached": e.reached,
        "reason": e.reason,
        "true_clearance_m": round(true_m, 5),
        "estimate_error_m": round(abs(e.smallest_clearance_m - true_m), 5),
        "plan_s": round(arena.plan.duration_s, 3),
        "drive_s": round(e.duration_s, 3),
        "cycles": len(e.gaits),
        "replans": e.replans,
        "latency_s": round(driven.latency.value_s, 5),
        "offset_m": round(driven.offset_m, 5),
        "repeats": driven.line.repeats,
        "cpu_s": round(time.process_time() - cpu, 2),
    }


def section(rows: list[dict[str, Any]], when: str) -> Section:
    """Return a line per cell size."""
    columns = [
        "cells (m)",
        "arrived",
        "touched",
        "least true clearance (mm)",
        "estimated clearance off by, most (mm)",
        "time over the plan's: median, most",
        "replans: mean",
        "camera found late by (ms)",
        "processor time (s)",
    ]
    lines = []
    for cell in sorted({row["cell_m"] for row in rows}, reverse=True):
        own = [row for row in rows if row["cell_m"] == cell]
        late = [row["drive_s"] / row["plan_s"] for row in own if row["reached"]] or [float("nan")]
        latency = [1e3 * row["latency_s"] for row in own]
        lines.append(
            [
                f"{cell:g}",
                f"{sum(row['reached'] for row in own)} of {len(own)}",
                str(sum(row["true_clearance_m"] <= 0 for row in own)),
                f"{1e3 * min(row['true_clearance_m'] for row in own):.1f}",
                f"{1e3 * max(row['estimate_error_m'] for row in own):.1f}",
                f"{np.median(late):.2f}, {max(late):.2f}",
                f"{np.mean([row['replans'] for row in own]):.1f}",
                f"{min(latency):.0f} to {max(latency):.0f}",
                f"{np.median([row['cpu_s'] for row in own]):.1f}",
            ]
        )
    i = DEFAULT
    notes = [
        f"Margin 5 mm; markers with {1e3 * i.noise_m:g} mm of noise, {1e3 * i.latency_s:g} ms late; line "
        f"{1e3 * i.line_s:g} ms each way; virtual clock. Times include settling (0.3 s) and coming to rest. "
        f"{when}"
    ]
    return Section("Pilot: contest mazes through firmware, valve line and camera", columns, lines, notes)


def run(quick: bool) -> Section:
    """Return what was measured last, quick or not; one maze, driven now, where nothing was."""
    stored = stored_rows(NAME)
    if stored is None:
        return section([drive_contest(1, 0.36)], "One maze only.")
    when, rows = stored
    return section(rows, f"Measured {when}.")


def main() -> None:
    """Run the study and print the table."""
    parser = study_parser(NAME, __doc__, sets=20)
    parser.add_argument("--cell", type=float, nargs="+", default=[0.36], metavar="M")
    options = parser.parse_args()
    items = [(seed, cell) for cell in options.cell for seed in range(options.sets)]
    print(section(gather(NAME, drive_contest, items, options), "").markdown())


if __name__ == "__main__":
    main()

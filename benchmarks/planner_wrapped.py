"""Corridors wrapped around a driven motion: is a way found where one is known to be?

python -m benchmarks.planner_wrapped [--shapes straight u-turn dead-end s] [--sets 2] [--jobs 2]

A sequence of gaits is certified on open floor, joining cycles and ramps of pressure included, and walls are
put at a distance from everything that the body sweeps. So a way is known that keeps this distance; the
planner knows the walls only. Gaits and counts of cycles are drawn at random.
"""

from __future__ import annotations

import math
import random
import time
from dataclasses import replace
from functools import lru_cache

import numpy as np
import shapely

from benchmarks.section import Section
from benchmarks.stored import Row, gather, stored_rows, study_parser
from planners.maze.maze import Maze
from planners.maze.places import Goal, Pose
from planners.maze.walls import Walls
from planners.motion.store import load_motion
from planners.motion.table import MotionTable
from planners.plan.certify import certify
from planners.plan.portfolio import PlanRequest, solve
from planners.search.problem import Problem
from srs_opt.gait_opt.catalogue import default_table
from srs_opt.gait_opt.table import GaitTable
from srs_opt.robot import Robot, wpi_srs

NAME = "planner_wrapped"
SHAPES = ("straight", "u-turn", "dead-end", "s")
ROOMS = ((0.010, 0.005), (0.005, 0.0045))  # of the corridor; the margin that the plan keeps, m
GOAL_RADIUS_M = 0.03
LIMIT_S = 60.0  # the command's
BEFORE = (
    "Before the search over runs of one gait 8 of these 16 were solved and 2 called infeasible. Long ways, "
    "measured once on 2026-11-29 with the planner as it is: a serpentine of 76 m (cells of 0.18 m, 304 "
    "cycles) in 28 s of processor time, 4 s of them the certificate: at least 4.996 mm, and 5.000 mm by the "
    "laboratory's simulation; a gate after 90 m of open floor (93 m, 331 cycles, margin 1 mm): at least 8.63 "
    "mm, and 9.23 mm."
)


def around(problem: Problem, gaits: list[int], room_m: float) -> Maze:
    """Return the maze of a corridor that keeps `room_m` from the body as it plays gaits on open floor."""
    certificate = certify(problem, gaits)
    half = problem.robot.body_width_m / 2
    bodies = shapely.buffer(shapely.linestrings(certificate.lines), half + room_m)
    straight = shapely.buffer(shapely.linestrings(certificate.lines[0]), half + room_m)
    free = shapely.union_all([straight, *bodies]).simplify(1e-5)
    box = tuple(float(side) for side in shapely.buffer(free, half).bounds)
    solid = shapely.get_parts(shapely.box(*box) - free)
    end = certificate.pose[-1]
    return replace(
        problem.maze,
        bounds=box,
        walls=Walls.of([(part, 0.0) for part in solid]),
        goal=Goal(float(end[0]), float(end[1]), GOAL_RADIUS_M),
    )


def drawn(shape: str, table: GaitTable, motion: MotionTable, rng: random.Random) -> list[int]:
    """Return a sequence of gaits of that shape, a cycle each."""
    entries, turn = table.gaits, motion.steady[:, 2]

    def pick(left: bool | None, back: bool = False) -> int:
        fitting = [
            k
            for k, entry in enumerate(entries)
            if (entry.speed_m_s < 0) == back
            and (entry.radius_m is None if left is None else entry.radius_m is not None)
            and (left is None or (turn[k] > 0) == left)
            and (left is None or abs(entry.radius_m or 0.0) < 0.4)
        ]
        return rng.choice(fitting)

    ahead, side = pick(None), rng.random() < 0.5
    if shape == "straight":
        return [ahead] * 8
    if shape == "u-turn":
        bend = pick(side)
        return [ahead] * 2 + [bend] * round(math.pi / abs(turn[bend])) + [ahead] * 2
    if shape == "dead-end":
        bend = pick(side, back=True)
        return [ahead] * 4 + [bend] * min(round(math.pi / 2 / abs(turn[bend])), 6)
    first, second = pick(side), pick(not side)
    counts = [max(2, round(math.pi / 2 / abs(turn[k]))) for k in (first, second)]
    return [ahead] * 3 + [first] * counts[0] + [second] * counts[1] + [ahead] * 2


@lru_cache(maxsize=1)
def setting() -> tuple[Robot, GaitTable, MotionTable]:
    """Return robot, gaits and motion; once per process."""
    robot = wpi_srs()
    gaits = default_table(robot).for_planning()
    return robot, gaits, load_motion(robot, gaits)


def problem_of(shape: str, room: tuple[float, float], seed: int) -> tuple[Problem, list[int]]:
    """Return the problem of a wrapped corridor, and the gaits that it was wrapped around."""
    robot, gaits, motion = setting()
    sequence = drawn(shape, gaits, motion, random.Random(f"{shape} {seed}"))
    reach = 1.0 + sum(math.hypot(*motion.steady[k, :2]) for k in sequence)
    floor = Maze(f"{shape} {seed}", (-reach, -reach, reach, reach), Walls.of([]))
    open_floor = floor.with_places(start=Pose(0.0, 0.0, 0.0), goal=Goal(-0.9 * reach, 0.9 * reach, 0.01))
    maze = around(Problem(robot, gaits, motion, open_floor, 0.0), sequence, room[0])
    return Problem(robot, gaits, motion, maze, room[1]), sequence


def attempt(shape: str, room_mm: float, seed: int) -> Row:
    """Return whether a plan is found and certified, and in how much time."""
    room = next(room for room in ROOMS if round(1e3 * room[0], 3) == room_mm)
    problem, sequence = problem_of(shape, room, seed)
    cpu = time.process_time()
    result = solve(problem, PlanRequest(time_limit_s=LIMIT_S))
    known = problem.motion.period_s[sequence].sum()
    return {
        "shape": shape,
        "room_mm": room_mm,
        "margin_mm": 1e3 * room[1],
        "seed": seed,
        "gaits": len(set(sequence)),
        "known_s": round(float(known), 3),
        "duration_s": round(result.plan.duration_s, 3) if result.plan else None,
        "planner": result.plan.planner if result.plan else None,
        "status": result.status,
        "cpu_s": round(time.process_time() - cpu, 2),
    }


def section(rows: list[Row], when: str) -> Section:
    """Return how many are solved, by shape and room."""
    cells = []
    for shape in (shape for shape in SHAPES if any(row["shape"] == shape for row in rows)):
        for room_mm in sorted({row["room_mm"] for row in rows}, reverse=True):
            mine = [row for row in rows if row["shape"] == shape and row["room_mm"] == room_mm]
            if not mine:
                continue
            solved = [row for row in mine if row["status"] == "solved"]
            longer = [row["duration_s"] / row["known_s"] for row in solved]
            cells.append(
                [
                    shape,
                    f"{room_mm:g}",
                    f"{mine[0]['margin_mm']:g}",
                    f"{len(solved)} of {len(mine)}",
                    f"{np.median(longer):.2f}" if longer else "none",
                    f"{np.median([row['cpu_s'] for row in mine]):.1f}",
                    f"{max(row['cpu_s'] for row in mine):.1f}",
                ]
            )
    titles = [
        "shape",
        "room (mm)",
        "margin (mm)",
        "solved",
        "time over the known way's",
        "median s",
        "most s",
    ]
    solved = sum(row["status"] == "solved" for row in rows)
    notes = [
        f"Solved and certified {solved} of {len(rows)} with a time limit of {LIMIT_S:g} s; processor time. "
        f"{when}"
    ]
    return Section("Planner: corridors wrapped around a motion", titles, cells, notes)


def run(quick: bool) -> Section:
    """Return the stored study; one quick attempt where there is none."""
    stored = None if quick else stored_rows(NAME)
    if stored is None:
        return section([attempt("straight", 10.0, 0)], "Quick.")
    when, rows = stored
    found = section(rows, when)
    return replace(found, notes=[*found.notes, BEFORE])


def main() -> None:
    """Run the suite and print the table."""
    parser = study_parser(NAME, __doc__, sets=2)
    parser.add_argument("--shapes", nargs="+", default=list(SHAPES), choices=SHAPES)
    options = parser.parse_args()
    items = [
        (shape, round(1e3 * room, 3), options.seed - 1 + k)
        for shape in options.shapes
        for room, _ in ROOMS
        for k in range(options.sets)
    ]
    print(section(gather(NAME, attempt, items, options), "").markdown())


if __name__ == "__main__":
    main()

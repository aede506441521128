"""Manoeuvres by free switching against sequences of table gaits for the same task.

python -m benchmarks.manoeuvre [--sets 1] [--jobs 2]

The rival of the standing start is the planner itself, in an open field whose goal begins at the line. The
turn has no such goal: its rival is the best of all pairs of the table's turning gaits, a cycle each, both at
the pressure of the second, which is broken off by venting where the end is at rest. A set is a seed.
"""

from __future__ import annotations

import math
import time
from functools import lru_cache

import numpy as np

from benchmarks.section import Section
from benchmarks.stored import Row, gather, stored_rows, study_parser
from planners.maze.maze import Maze
from planners.maze.places import Goal, Pose
from planners.motion.store import load_motion
from planners.plan.portfolio import PlanRequest, solve
from planners.search.problem import Problem
from srs_opt.gait import Gait
from srs_opt.gait_opt.catalogue import default_table
from srs_opt.manoeuvre.search import find
from srs_opt.manoeuvre.settings import END
from srs_opt.manoeuvre.shooting import shoot
from srs_opt.manoeuvre.starts import vented
from srs_opt.manoeuvre.task import End, Start, Task
from srs_opt.manoeuvre.valves import ValvePlan
from srs_opt.orbit.body import integrator
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs

NAME = "manoeuvre"
QUARTER = math.pi / 2
TASKS = ("standing start to 1 m", "quarter turn, passed", "quarter turn, at rest", "stop within 0.15 m",
         "rest to the fast gait", "fast to the turning gait")  # fmt: skip


@lru_cache(maxsize=1)
def problem() -> Problem:
    """Return the open field."""
    robot = wpi_srs()
    table = default_table(robot)
    goal = Goal(2.0, 0.0, 0.0, boxes=((1.0, -2.0, 4.0, 2.0),))
    maze = Maze("open", (-1.0, -2.0, 4.0, 2.0), start=Pose(0.0, 0.0, 0.0), goal=goal)
    return Problem(robot, table, load_motion(robot, table), maze, 0.005)


def task_named(name: str) -> Task:
    """Return what is wanted."""
    robot, table = problem().robot, problem().gaits
    run = integrator(robot)
    fast = table["fast"].gait
    rest, moving = Start.at_rest(run), Start.in_gait(run, robot, fast)
    return {
        TASKS[0]: lambda: Task(rest, End(past_m=1.0)),
        TASKS[1]: lambda: Task(rest, End(turn_rad=QUARTER)),
        TASKS[2]: lambda: Task(rest, End(turn_rad=QUARTER, rest=True)),
        TASKS[3]: lambda: Task(moving, End(rest=True, within_m=0.15)),
        TASKS[4]: lambda: Task(rest, End(orbit=steady_gait(robot, fast))),
        TASKS[5]: lambda: Task(moving, End(orbit=steady_gait(robot, table["fast R0.314 left"].gait))),
    }[name]()


def rival_s(name: str) -> float | None:
    """Return the time of the best sequence of table gaits, None where the table has none."""
    if name == TASKS[0]:
        plan = solve(problem(), PlanRequest()).plan
        return None if plan is None else plan.duration_s
    if name not in TASKS[1:3]:
        return None
    gaits = [entry.gait for entry in problem().gaits.gaits if entry.turn_rate_rad_s > 1.0]
    plans = [_sequence(pair) for pair in ((a, b) for a in gaits for b in gaits)]
    run = integrator(problem().robot)
    best = math.inf
    for shot in shoot(run, run.rest(), plans, 0.0025):
        turned = shot.states[:, 2] >= QUARTER
        if name == TASKS[1] and turned.any():
            best = min(best, float(shot.time_s[turned.argmax()]))
    if name == TASKS[1]:
        return best
    cut = [
        vented(ValvePlan.of_gaits((a, b), played), 0.6)
        for a in gaits[::2]
        for b in gaits[::2]
        for played in np.arange(0.5, min(a.period_s + b.period_s, 1.3), 0.04)
    ]
    for k in range(0, len(cut), 64):
        for shot in shoot(run, run.rest(), cut[k : k + 64], 0.0025):
            states = shot.states
            slow = np.hypot(states[:, 3], states[:, 4]) < END.rest_speed_m_s
            straight = np.abs(states[:, run.layout.kappa]).max(axis=1) < END.rest_curvature_1_m
            done = slow & straight & (states[:, 2] >= QUARTER) & (shot.time_s > shot.plan.duration_s - 0.6)
            if done.any():
                best = min(best, float(shot.time_s[done.argmax()]))
    return best


def _sequence(gaits: tuple[Gait, Gait]) -> ValvePlan:
    return ValvePlan.of_gaits(gaits, sum(g.period_s for g in gaits))


def attempt(name: str, seed: int) -> Row:
    """Return one task's times."""
    cpu = time.process_time()
    task = task_named(name)
    run = integrator(problem().robot)
    found = find(run, task, [entry.gait for entry in problem().gaits.gaits], seed=seed)
    ours = time.process_time() - cpu
    return {
        "task": name,
        "seed": seed,
        "duration_s": found.plan.duration_s,
        "passed": found.certificate.passed,
        "first_s": found.first_s,
        "rival_s": rival_s(name),
        "cpu_s": round(ours, 1),
    }


def section(rows: list[Row], when: str) -> Section:
    """Return the times as a table."""
    cells = [
        [
            row["task"],
            str(row["seed"]),
            f"{row['duration_s']:.3f}",
            "passed" if row["passed"] else "failed",
            "-" if row["rival_s"] is None else f"{row['rival_s']:.3f}",
            "-" if row["rival_s"] is None else f"{100 * (1 - row['duration_s'] / row['rival_s']):.1f} %",
            "-" if row["cpu_s"] is None else f"{row['cpu_s']:.0f}",
        ]
        for row in rows
    ]
    columns = ["task", "seed", "time, s", "certificate", "table gaits, s", "shorter by", "processor time, s"]
    notes = [f"Measured {when}."]
    notes += [f"{row['task']}: {row['effort']} only." for row in rows if "effort" in row]
    return Section("Manoeuvres against sequences of table gaits", columns, cells, notes)


def run(quick: bool) -> Section:
    """Return what is stored, for the report of all benchmarks."""
    stored = stored_rows(NAME)
    if stored is None:
        return section([], "never")
    return section(stored[1], stored[0])


def main() -> None:
    """Measure and store."""
    options = study_parser(NAME, __doc__, 1).parse_args()
    seeds = range(options.seed, options.seed + options.sets)
    gather(NAME, attempt, [(name, seed) for name in TASKS for seed in seeds], options)
    print(run(False).markdown())


if __name__ == "__main__":
    main()

"""What a drive calibrated from maps is worth: plans with and without it, on a robot with wider turns.

    python -m benchmarks.planner_drive [--mazes NAME ...] [--share 0.84]

The true robot's segments bend less than the model's, so that the radii of its turns are a quarter larger.
Only a measured map of speed and radius is known of it. Open loop: where the plan's valves alone lead it.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import lru_cache

import numpy as np

from benchmarks.planner_mazes import MARGIN_M
from benchmarks.planner_traverse import maze_named
from benchmarks.section import Section
from planners.drive.execute import execute
from planners.maze.places import RobotSize
from planners.motion.bending import Bending
from planners.motion.store import load_motion
from planners.plan.answer import Plan
from planners.plan.solve import solve_with_lattice
from planners.search.problem import Problem
from planners.search.tree import at_rest
from srs_opt.drive.calibration import DriveCalibration, fit_calibration
from srs_opt.gait import Wave
from srs_opt.gait_opt.catalogue import default_table
from srs_opt.orbit.steady import steady_gaits
from srs_opt.robot import Robot, wpi_srs
from srs_opt.simulate.integrate import Integrator

BENDS = 0.84  # times the model's curvature: radii 1.25 times as large
MAZES = ("first", "u_turn", "slalom", "rooms", "blocks", *(f"cells {seed}" for seed in range(6)))
QUICK = ("first",)
LIMIT_S = 600.0  # of the wall clock: a busy machine decides nothing
ERROR = 0.02  # relative standard deviation of what is measured, one value per gait


def true_robot(bends: float = BENDS) -> Robot:
    """Return the robot that is measured and driven."""
    robot = wpi_srs()
    return robot.with_values(curvature_per_pressure_1_m_kpa=bends * robot.curvature_per_pressure_1_m_kpa)


@lru_cache(maxsize=4)
def measured(bends: float = BENDS, seed: int = 0) -> DriveCalibration:
    """Return the factors that a map of 12 waves of the true robot gives, measured with errors."""
    settings = [(p, lag, o) for p in (41.0, 50.0) for lag in (0.9, 1.2) for o in (0.2, 0.4, 0.7)]
    waves = [Wave.uniform(4, 2.0, p, lag, o).gait() for p, lag, o in settings]
    rng = np.random.default_rng(seed)
    maps = []
    for robot in (wpi_srs(), true_robot(bends)):
        orbits = steady_gaits(robot, waves)
        maps.append(np.array([(o.speed_m_s, o.radius_m) for o in orbits]).T)
    found = maps[1] * (1 + ERROR * rng.standard_normal(maps[1].shape))
    sd = ERROR * np.abs(found)
    return fit_calibration(*maps[0], found[0], sd[0], found[1], sd[1])


def open_loop_m(problem: Problem, plan: Plan, robot: Robot) -> float:
    """Return how far from the goal the plan's valves alone bring a robot."""
    run, root = Integrator(robot, problem.gaits.model), at_rest(problem)
    state, before = root.state, root.gait
    for gait in plan.gaits:
        state = run.integrate(problem.joints.timeline(before, gait), state).final
        before = gait
    return max(0.0, float(problem.goal.distance(state[:2])))


def rows(
    names: tuple[str, ...], bends: float = BENDS
) -> list[tuple[str, list[float], list[int], list[bool]]]:
    """Return per maze: open-loop misses (m), new plans and arrivals, without and with the drive."""
    robot, true, drive = wpi_srs(), true_robot(bends), measured(bends)
    table = default_table(robot)
    motion = load_motion(robot, table)
    size = RobotSize(robot.length_m, robot.body_width_m / 2, MARGIN_M)
    found = []
    for name in names:
        plain = Problem(robot, table, motion, maze_named(name, size), MARGIN_M)
        bent = replace(plain, motion=motion.bent(Bending(drive, motion.course)), drive=drive)
        misses, replans, arrived = [], [], []
        for problem in (plain, bent):
            plan = solve_with_lattice(problem, time_limit_s=LIMIT_S).plan
            if plan is None:
                misses.append(np.nan)
                replans.append(-1)
                arrived.append(False)
                continue
            misses.append(open_loop_m(problem, plan, true))
            driven = execute(problem, plan, true)
            replans.append(driven.replans)
            arrived.append(driven.reached)
        found.append((name, misses, replans, arrived))
    return found


def section(names: tuple[str, ...], bends: float = BENDS) -> Section:
    """Return the comparison, a line per maze."""
    study = rows(names, bends)
    lines = [
        [
            name,
            *("none" if np.isnan(m) else f"{1e3 * m:.0f}" for m in misses),
            *("-" if r < 0 else str(r) for r in replans),
            *("yes" if a else "no" for a in arrived),
        ]
        for name, misses, replans, arrived in study
    ]
    both = [row for row in study if not np.isnan(row[1]).any()]
    miss = np.median([misses for _, misses, _, _ in both], axis=0)
    replans = np.sum([replans for _, _, replans, _ in both], axis=0)
    reached = np.sum([arrived for *_, arrived in study], axis=0)
    drive = measured(bends)
    notes = [
        f"Factors of the measured map: speed {drive.speed.value:.3f}, radius {drive.radius.value:.3f}. "
        f"Where both plan: median miss {1e3 * miss[0]:.0f} mm without, {1e3 * miss[1]:.0f} mm with; "
        "new plans in all "
        f"{replans[0]} and {replans[1]}. Arrived: {reached[0]} and {reached[1]} of {len(study)}."
    ]
    columns = ["maze", "miss (mm)", "with drive", "new plans", "with drive", "arrived", "with drive"]
    return Section("Planner: a drive calibrated from maps", columns, lines, notes)


def run(quick: bool) -> Section:
    """Compare, for the report of all benchmarks."""
    return section(QUICK if quick else MAZES)


def main() -> None:
    """Compare and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mazes", nargs="+", default=list(MAZES), help="names, or 'cells SEED'")
    parser.add_argument(
        "--share", type=float, default=BENDS, help="of the model's bend that the true robot has"
    )
    options = parser.parse_args()
    print(section(tuple(options.mazes), options.share).markdown())


if __name__ == "__main__":
    main()

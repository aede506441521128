"""Narrow passages: success against width, beside OMPL's planners alone with the same body and model.

python -m benchmarks.planner_narrow [--ratios 1.05 1.15 1.3 1.6 2.0] [--seeds 2] [--iterations 1000]

Widths are multiples of what the table's slimmest straight gait sweeps. Every planner's way passes the
same certificate before it counts.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from pathlib import Path

from planners.generate.areas import corridor
from planners.maze.places import RobotSize
from planners.motion.store import load_motion
from planners.plan.certify import certify
from planners.plan.portfolio import ompl_gaits
from planners.plan.solve import solve_with_lattice
from planners.search.problem import Problem
from srs_opt.files import write_json
from srs_opt.gait_opt.catalogue import default_table
from srs_opt.robot import wpi_srs

MARGIN_M = 0.001
RIVALS = ("dubins-bitstar", "dubins-rrtconnect", "rrt", "est", "kpiece")


def attempt(problem: Problem, planner: str, iterations: int, seed: int) -> bool:
    """Whether a planner finds a plan that passes the certificate."""
    if planner == "lattice":
        return solve_with_lattice(problem, max_nodes=20_000, time_limit_s=120.0).plan is not None
    gaits = ompl_gaits(problem, planner, iterations, seed)
    return gaits is not None and certify(problem, gaits).passed


def main() -> None:
    """Run the suite and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ratios", type=float, nargs="+", default=[1.05, 1.15, 1.3, 1.6, 2.0])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--iterations", type=int, default=1000)
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks/planner_narrow.json"))
    options = parser.parse_args()
    robot = wpi_srs()
    gaits = default_table(robot)
    motion = load_motion(robot, gaits)
    slimmest = min(sum(e.envelope_m) for e in gaits.gaits if e.radius_m is None)
    size = RobotSize(robot.length_m, robot.body_width_m / 2, MARGIN_M)
    print(f"slimmest straight gait sweeps {slimmest:.4f} m; solved of {options.seeds}, mean CPU s")
    print("ratio   width  " + "".join(f"{name:>20}" for name in ("lattice", *RIVALS)))
    rows = []
    for ratio in options.ratios:
        line = f"{ratio:5.2f}  {ratio * slimmest:.4f} "
        for planner in ("lattice", *RIVALS):
            solved, cpu = 0, time.process_time()
            for seed in range(options.seeds):
                maze = corridor(0.3, ratio * slimmest, 0.5, random.Random(seed), size)
                solved += attempt(
                    Problem(robot, gaits, motion, maze, MARGIN_M), planner, options.iterations, seed
                )
            cpu = (time.process_time() - cpu) / options.seeds
            rows.append({"ratio": ratio, "planner": planner, "solved": solved, "cpu_s": cpu})
            line += f"{solved:>12d} {cpu:6.2f}s"
            print(rows[-1], file=sys.stderr, flush=True)
        print(line, flush=True)
    write_json(options.out, rows)


if __name__ == "__main__":
    main()

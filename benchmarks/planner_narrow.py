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
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.section import Section
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


def run(quick: bool) -> Section:
    """Return the report of a few widths; `main` asks more seeds and iterations."""
    planners = ("lattice", "dubins-rrtconnect") if quick else ("lattice", *RIVALS)
    rows = study((1.6,) if quick else (1.05, 1.3, 1.6, 2.0), 1, 30 if quick else 1000, planners)
    ratios = sorted({row["ratio"] for row in rows})
    told = {(row["ratio"], row["planner"]): f"{row['solved']}, {row['cpu_s']:.1f} s" for row in rows}
    lines = [[f"{ratio:g}", *[told[ratio, planner] for planner in planners]] for ratio in ratios]
    notes = [
        "A corridor 0.5 m long, its width in what the slimmest straight gait sweeps: certified plans found, "
        "of one, and processor time. OMPL's planners have the same body and model, and 1000 iterations."
    ]
    return Section("Narrow passages", ["width", *planners], lines, notes)


def study(
    ratios: Sequence[float], seeds: int, iterations: int, planners: Sequence[str]
) -> list[dict[str, Any]]:
    """Return how many certified plans each planner finds at each width, and its mean processor time."""
    robot = wpi_srs()
    gaits = default_table(robot)
    motion = load_motion(robot, gaits)
    slimmest = min(sum(e.envelope_m) for e in gaits.gaits if e.radius_m is None)
    size = RobotSize(robot.length_m, robot.body_width_m / 2, MARGIN_M)
    rows = []
    for ratio in ratios:
        for planner in planners:
            solved, cpu = 0, time.process_time()
            for seed in range(seeds):
                maze = corridor(0.3, ratio * slimmest, 0.5, random.Random(seed), size)
                solved += attempt(Problem(robot, gaits, motion, maze, MARGIN_M), planner, iterations, seed)
            cpu = (time.process_time() - cpu) / seeds
            rows.append({"ratio": ratio, "planner": planner, "solved": solved, "cpu_s": cpu})
            print(rows[-1], file=sys.stderr, flush=True)
    return rows


def main() -> None:
    """Run the suite and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ratios", type=float, nargs="+", default=[1.05, 1.15, 1.3, 1.6, 2.0])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--iterations", type=int, default=1000)
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks/planner_narrow.json"))
    options = parser.parse_args()
    planners = ("lattice", *RIVALS)
    rows = study(options.ratios, options.seeds, options.iterations, planners)
    print(f"solved of {options.seeds}, mean CPU s")
    print("ratio  " + "".join(f"{name:>20}" for name in planners))
    for ratio in options.ratios:
        cells = (f"{r['solved']:>12d} {r['cpu_s']:6.2f}s" for r in rows if r["ratio"] == ratio)
        print(f"{ratio:5.2f}  " + "".join(cells))
    write_json(options.out, rows)


if __name__ == "__main__":
    main()

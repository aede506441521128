"""Gait optimization on random robots that the tests leave out, without tuning.

python -m benchmarks.gait_opt_robots [--sets 12] [--jobs 2]

A set is a robot, friction and time constants at random, one start. The tests do the same for one robot each
of 3, 5 and 8 links: searches on some others take a minute, and a new length's equations compile for long.
"""

from __future__ import annotations

import math
import time

import numpy as np

from benchmarks.section import Section
from benchmarks.stored import Row, gather, stored_rows, study_parser
from srs_opt.gait import published_wave
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.search import search
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import Robot, wpi_srs

NAME = "gait_opt_robots"
# links, seed
ROBOTS = ((3, 0), (3, 4), (4, 5), (5, 6), (5, 7), (4, 1), (6, 3), (7, 1), (9, 2), (10, 3), (11, 4), (12, 5))
COLUMNS = ["links", "published gait, m/s", "found, m/s", "certificate", "processor s"]


def random_robot(links: int, seed: int) -> Robot:
    """Return a robot of so many links: friction 0.3 to 0.9 across, 3 to 30 times less along."""
    random = np.random.default_rng(seed)
    normal = random.uniform(0.3, 0.9)
    return wpi_srs().with_values(
        links=links,
        friction_normal=normal,
        friction_tangential=normal / math.exp(random.uniform(math.log(3), math.log(30))),
        tau1_s=random.uniform(0.04, 0.15),
        tau2_s=random.uniform(0.02, 0.1),
    )


def attempt(links: int, seed: int) -> Row:
    """Return what one robot's search finds."""
    robot = random_robot(links, seed)
    published = steady_gait(robot, published_wave(robot, 2.0, 55.0).gait()).speed_m_s
    begun = time.process_time()
    found = search(CycleProblem((robot,), "complex", Goal(), Limits()), starts=1)
    return {
        "links": links,
        "seed": seed,
        "published_m_s": published,
        "speed_m_s": found.orbits[0].speed_m_s,
        "passed": found.certificate.passed,
        "cpu_s": round(time.process_time() - begun, 1),
    }


def section(rows: list[Row], when: str) -> Section:
    """Return the rows as a table."""
    cells = [
        [
            str(row["links"]),
            f"{row['published_m_s']:.3f}",
            f"{row['speed_m_s']:.3f}",
            "passed" if row["passed"] else "failed",
            f"{row['cpu_s']:.0f}",
        ]
        for row in rows
    ]
    return Section("Gait optimization on random robots", COLUMNS, cells, [f"Measured {when}."])


def run(quick: bool) -> Section:
    """Return what is stored, for the report of all benchmarks."""
    stored = stored_rows(NAME)
    return section([], "never") if stored is None else section(stored[1], stored[0])


def main() -> None:
    """Measure and store."""
    options = study_parser(NAME, __doc__, len(ROBOTS)).parse_args()
    gather(NAME, attempt, ROBOTS[: options.sets], options)
    print(run(False).markdown())


if __name__ == "__main__":
    main()

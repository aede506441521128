"""One small gait table with its motion."""

from __future__ import annotations

import pytest

from planners.motion.transitions import motion_table, simulate_transitions
from planners.search.problem import Problem
from srs_opt.gait import Wave
from srs_opt.gait_opt.table import GaitTable, TableGait
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs

# frequency Hz, pressure kPa, lag rad, offset: fast, gentle, tight, slim
WAVES = {
    "fast": (2.0, 41.0, 0.9, 0.0),
    "gentle": (2.0, 41.0, 0.9, 0.3),
    "tight": (2.0, 50.0, 1.2, 0.75),
    "slim": (2.0, 26.0, 1.1, 0.0),
}


@pytest.fixture(scope="session")
def robot():
    return wpi_srs()


@pytest.fixture(scope="session")
def gaits(robot):
    """Six forward gaits (turns to both sides) and one that backs up."""
    entries = []
    for name, (frequency, pressure, lag, offset) in WAVES.items():
        gait = Wave.uniform(robot.segments, frequency, pressure, lag, offset).gait()
        sides = {f"{name} left": gait, f"{name} right": gait.mirrored()} if offset else {name: gait}
        entries += [TableGait.of_orbit(key, steady_gait(robot, g)) for key, g in sides.items()]
    back = Wave.uniform(robot.segments, 2.0, 41.0, 0.9).gait().reversed_wave()
    entries.append(TableGait.of_orbit("back", steady_gait(robot, back)))
    return GaitTable(robot.name, robot.fingerprint(), "complex", tuple(entries))


@pytest.fixture(scope="session")
def transitions(robot, gaits):
    return simulate_transitions(robot, gaits)


@pytest.fixture(scope="session")
def motion(robot, gaits, transitions):
    return motion_table(robot, gaits, transitions)


@pytest.fixture(scope="session")
def problem_in(robot, gaits, motion):
    """Return a function from mazes to problems."""
    return lambda maze, margin=0.005: Problem(robot, gaits, motion, maze, margin)

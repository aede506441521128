"""Which gaits of a file are judged, and which of them finely."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from srs_opt.errors import InputError
from srs_opt.files import read_text
from srs_opt.gait_file import load_gait
from srs_opt.gait_opt.table import load_table
from srs_opt.judge.opinion import Case
from srs_opt.robot import Robot


def cases_of(file: str, robot: Robot, pressure_kpa: float, refined: int, seed: int) -> list[Case]:
    """Return the gaits of a file; of a table, `refined` ones are judged finely.

    Raises
    ------
    InputError
        If the file holds no gaits, or gaits of another robot.
    """
    if Path(file).suffix.lower() == ".json" and Path(file).is_file() and _is_table(file):
        table = load_table(file)
        chosen = np.random.default_rng(seed).permutation(len(table.gaits))[:refined]
        cases = [Case(g.name, g.gait, k in chosen) for k, g in enumerate(table.gaits)]
    else:
        cases = [Case(Path(file).name, load_gait(file, pressure_kpa), True)]
    segments = cases[0].gait.segments
    if segments != robot.segments:
        raise InputError(
            f"{file}: its gaits drive {segments} segments, robot '{robot.name}' has {robot.segments}; "
            "name the robot with --robot"
        )
    return cases


def _is_table(file: str) -> bool:
    return '"gaits"' in read_text(file, "a gait or a gait table (JSON)")

"""A table's gaits on another robot: the same valve timing, with that robot's motion."""

from __future__ import annotations

from dataclasses import replace

from srs_opt.errors import NoAnswerError
from srs_opt.gait_opt.table import GaitTable, TableGait
from srs_opt.gait_opt.table_settings import TABLE
from srs_opt.orbit.steady import steady_gaits
from srs_opt.robot import Robot


def replayed(robot: Robot, table: GaitTable, model: str | None = None, *, jobs: int = 1) -> GaitTable:
    """Return the gaits of `table` as `robot` runs them from rest, without the unstable and the very slow.

    Raises
    ------
    NoAnswerError
        If no gait is left.
    """
    model = model or robot.own_model
    orbits = steady_gaits(robot, [entry.gait for entry in table.gaits], model, jobs=jobs)
    gaits = tuple(
        replace(TableGait.of_orbit(entry.name, orbit), planned=entry.planned)
        for entry, orbit in zip(table.gaits, orbits)
        if not isinstance(orbit, NoAnswerError)
        and orbit.largest_multiplier < 1
        and abs(orbit.speed_m_s) > TABLE.slowest_replayed_m_s
    )
    if not gaits:
        raise NoAnswerError(f"robot '{robot.name}' does not move with any gait of '{table.robot_name}'")
    return GaitTable(robot.name, robot.fingerprint(), model, gaits)

"""The gait table that belongs to a robot: shipped, cached, or built once and kept."""

from __future__ import annotations

from collections.abc import Callable
from importlib import resources
from pathlib import Path

from srs_opt.errors import InputError
from srs_opt.gait_opt.replayed import replayed
from srs_opt.gait_opt.table import GaitTable, load_table, save_table
from srs_opt.robot import Robot, wpi_srs

SHIPPED = "wpi_srs_table.json"


def shipped_table() -> GaitTable:
    """Return the table of the built-in robot that comes with the package."""
    with resources.as_file(resources.files("srs_opt.gait_opt").joinpath("data").joinpath(SHIPPED)) as path:
        return load_table(path, wpi_srs())


def cached_table_path(robot: Robot, model: str = "complex") -> Path:
    """Return where the table of `robot` is kept once it is built."""
    from srs_opt.simulate.compiled import cache_folder

    return cache_folder() / f"table_{model}_{robot.fingerprint()}.json"


def default_table(
    robot: Robot,
    model: str = "complex",
    say: Callable[[str], None] | None = None,
    *,
    driver: bool = False,
) -> GaitTable:
    """Return the gait table of `robot`: shipped with the package, built before, or built now.

    Parameters
    ----------
    say : callable, optional
        Told about progress while a table is built (one to two minutes).
    driver : bool
        With the slow gaits and pivots at its end that a driver needs and planners do not use. They are there
        where the table was shipped or made by ``gait_opt --table``.
    """
    table = _whole_table(robot, model, say)
    return table if driver else table.for_planning()


def _whole_table(robot: Robot, model: str, say: Callable[[str], None] | None) -> GaitTable:
    if model == "complex" and robot.fingerprint() == wpi_srs().fingerprint():
        return shipped_table()
    path = cached_table_path(robot, model)
    if path.exists():
        try:
            return load_table(path, robot)
        except InputError:  # an old version or a damaged file: build it again
            path.unlink(missing_ok=True)
    if model == "compliant":
        rigid = robot.with_values(bending_stiffness_n_m2=None, gap_stiffness_n_m2=None)
        table = replayed(robot, _whole_table(rigid, "complex", say), model)
    else:
        from srs_opt.gait_opt.family import build_table

        table = build_table(robot, model, say=say or (lambda text: None))
    save_table(table, path)
    return table

"""The gait table that belongs to a robot: shipped, cached, or built once and kept."""

from __future__ import annotations

from collections.abc import Callable
from importlib import resources
from pathlib import Path

from srs_opt.errors import InputError
from srs_opt.gait_opt.goal import Limits
from srs_opt.gait_opt.robust import stiffness_deviation, stiffness_interval
from srs_opt.gait_opt.table import GaitTable, load_table, save_table
from srs_opt.gait_opt.table_settings import TABLE
from srs_opt.robot import Robot, wpi_srs

SHIPPED = "wpi_srs_table.json"


def shipped_table() -> GaitTable:
    """Return the table of the built-in robot that comes with the package."""
    with resources.as_file(resources.files("srs_opt.gait_opt").joinpath("data").joinpath(SHIPPED)) as path:
        return load_table(path, wpi_srs())


def cached_table_path(robot: Robot, model: str = "complex") -> Path:
    """Return where the table of `robot` is kept once it is built.

    Tables of soft robots depend on how far the stiffness may be off, which the fingerprint leaves out.
    """
    from srs_opt.simulate.compiled import cache_folder

    deviation = f"_sd{stiffness_deviation(robot):.4g}" if model == "compliant" else ""
    return cache_folder() / f"table_{model}_{robot.fingerprint()}{deviation}.json"


def known_table(robot: Robot, model: str = "complex") -> GaitTable | None:
    """Return the table of `robot` that comes with the package or was built before, if there is one."""
    if model == "complex" and robot.fingerprint() == wpi_srs().fingerprint():
        return shipped_table()
    path = cached_table_path(robot, model)
    if path.exists():
        try:
            return load_table(path, robot)
        except InputError:  # an old version or a damaged file: build it again
            path.unlink(missing_ok=True)
    return None


def default_table(
    robot: Robot,
    model: str = "complex",
    say: Callable[[str], None] | None = None,
    *,
    driver: bool = False,
) -> GaitTable:
    """Return the gait table of `robot`: shipped with the package, built before, or built now.

    That of a soft robot has the gaits of the rigid one and the robust gait with its companions, as it moves
    by them; with a deviation of its stiffness, those that serve its whole interval (`stiffness_interval`).

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
    table = known_table(robot, model)
    if table is not None:
        return table
    tell = say or (lambda text: None)
    if model == "compliant":
        from srs_opt.gait_opt.robust_table import chosen_table

        rigid = robot.with_values(bending_stiffness_n_m2=None, gap_stiffness_n_m2=None)
        basis = _whole_table(rigid, "complex", say)
        tell("choosing gaits for this stiffness (once per robot)")
        limits = Limits(pressure_kpa=TABLE.pressure_kpa)
        table = chosen_table(stiffness_interval(robot), model, basis, limits, say=tell)
    else:
        from srs_opt.gait_opt.family import build_table

        table = build_table(robot, model, say=tell)
    save_table(table, cached_table_path(robot, model))
    return table

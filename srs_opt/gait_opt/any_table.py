"""Gait tables of one robot, of several, or of one whose stiffness is not known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from srs_opt.gait_opt.catalogue import cached_table_path, known_table
from srs_opt.gait_opt.entries import certified_table
from srs_opt.gait_opt.family import build_table
from srs_opt.gait_opt.goal import Limits
from srs_opt.gait_opt.robust import in_the_middle, of_stiffness
from srs_opt.gait_opt.robust_table import chosen_table
from srs_opt.gait_opt.settings import STIFFNESS
from srs_opt.gait_opt.table import GaitTable, save_table
from srs_opt.gait_opt.table_settings import TABLE
from srs_opt.robot import Robot

Say = Callable[[str], None]


def usual(limits: Limits) -> bool:
    """Whether these are the limits of default tables."""
    return limits == Limits(pressure_kpa=TABLE.pressure_kpa)


def unknown_stiffness(robot: Robot) -> bool:
    """Whether a robot may have any stiffness that silicone segments have: its file gives none.

    Not robots with more links than the compliant model is compiled for in reasonable time.
    """
    return not robot.is_soft and robot.links <= STIFFNESS.most_links


def of_any_stiffness(robot: Robot) -> tuple[Robot, ...]:
    """Return the bodies that a table for an unknown stiffness serves, that of the table's motions first."""
    return in_the_middle([of_stiffness(robot, ei) for ei in STIFFNESS.silicone_n_m2])


def unknown_words(robot: Robot) -> str:
    """Say whom the table serves, and how to ask for another."""
    return (
        f"robot '{robot.name}' gives no bending stiffness: the table serves all of "
        f"{', '.join(f'{ei:g}' for ei in STIFFNESS.silicone_n_m2)} N m^2; for one that is rigid: "
        "--model complex"
    )


def make_table(
    robots: Sequence[Robot],
    model: str,
    limits: Limits,
    unfinished: Path,
    worst: str,
    say: Say,
    *,
    jobs: int,
    cluster: str | None,
    quick: bool = False,
) -> GaitTable:
    """Return the table of a robot, optimized, or of several, chosen; what is optimized is kept on the way.

    Parameters
    ----------
    unfinished : Path
        Where optimizations are kept until the table is done.
    worst : {"relative", "absolute"}
        What counts of several robots.
    quick : bool
        Few gaits, none for drivers alone.
    """

    def built(robot: Robot, model: str) -> GaitTable:
        return build_table(
            robot,
            model,
            limits,
            say,
            jobs=jobs,
            cluster=cluster,
            resume=unfinished,
            driver=not quick,
            quick=quick,
        )

    if len(robots) == 1:
        return built(robots[0], model)
    rigid = robots[0].with_values(bending_stiffness_n_m2=None, gap_stiffness_n_m2=None)
    basis = known_table(rigid) if usual(limits) else None
    if basis is None:
        say("first the gaits of the rigid robot, to choose from")
        basis = built(rigid, "complex")
        if usual(limits) and not quick:
            save_table(basis, cached_table_path(rigid))
    table = chosen_table(tuple(robots), model, basis, limits, worst, say, jobs=jobs)
    return certified_table(robots[0], table, limits, say, jobs=jobs, cluster=cluster)

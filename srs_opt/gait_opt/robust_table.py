"""A gait table for several robots: for segments of unknown stiffness above all.

Optimizing every entry for all robots takes hours (a robust gait takes minutes). Here entries are chosen,
not optimized: those of the rigid robot's table and the robust gait with its turning companions, simulated on
every robot. What is unstable, hardly moves or turns to another side on one of them is left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from srs_opt.errors import InputError, NoAnswerError
from srs_opt.gait import Gait, published_wave
from srs_opt.gait_opt.companions import duty_biased_gaits
from srs_opt.gait_opt.corrections import on_ticks
from srs_opt.gait_opt.goal import Limits
from srs_opt.gait_opt.settings import GOAL
from srs_opt.gait_opt.softness import robust_beside
from srs_opt.gait_opt.table import GaitTable, TableGait
from srs_opt.gait_opt.table_settings import TABLE
from srs_opt.orbit.steady import Orbit, steady_gait, steady_gaits
from srs_opt.robot import Robot

Say = Callable[[str], None]


def robust_companions(robot: Robot, limits: Limits) -> list[tuple[str, Gait]]:
    """Return the robust gait, straight and duty-biased, by name; none for robots with other segments."""
    gait = robust_beside(robot, limits)
    if gait is None:
        return []
    family = duty_biased_gaits(gait, limits.tick_s)
    return [(_name(name), on_ticks(other, limits.tick_s)) for name, other in family]


def _name(leaning: str) -> str:
    """Return an entry's name, as "robust L0.3 back", for that of a companion, "+0.3 back"."""
    offset, *way = leaning.split()
    side = {"+": "L", "-": "R"}[offset[0]] if float(offset) else ""
    return " ".join(["robust", *([side + offset[1:]] if side else []), *way])


def chosen_table(
    robots: tuple[Robot, ...],
    model: str,
    rigid: GaitTable,
    limits: Limits,
    worst: str = "relative",
    say: Say = lambda text: None,
    *,
    jobs: int = 1,
) -> GaitTable:
    """Return the gaits that serve all `robots`, the best worst speed first; the motion is the first robot's.

    The entries carry no certificates.

    Parameters
    ----------
    rigid : GaitTable
        Gaits to choose from, besides the robust gait and its companions.
    worst : {"relative", "absolute"}
        What counts of the robots: speed over the published gait's, or speed.

    Raises
    ------
    InputError
        If the robots have different numbers of links.
    NoAnswerError
        If no gait serves all, or the published gait does not move one of them.
    """
    if len({robot.links for robot in robots}) > 1:
        raise InputError("a gait table for several robots needs the same number of links in all of them")
    named = [(entry.name, entry.gait, entry.planned) for entry in rigid.gaits]
    named += [(name, gait, True) for name, gait in robust_companions(robots[0], limits)]
    named = [asked for asked in named if _allowed(asked[1], limits)]
    found = [steady_gaits(robot, [gait for _, gait, _ in named], model, jobs=jobs) for robot in robots]
    scale = np.ones(len(robots))
    if worst == "relative" and len(robots) > 1:
        fastest = (limits.frequency_hz[1], limits.pressure_kpa[1])
        published = (steady_gait(r, published_wave(r, *fastest).gait(), model) for r in robots)
        scale = np.array([orbit.speed_m_s for orbit in published])
    kept: list[tuple[float, TableGait]] = []
    for (name, _, planned), orbits in zip(named, zip(*found)):
        if good := _alike(orbits):
            speeds = np.array([abs(orbit.speed_m_s) for orbit in good])
            slowest = float(speeds.min()) if len(robots) > 1 else None
            entry = replace(TableGait.of_orbit(name, good[0]), worst_speed_m_s=slowest, planned=planned)
            kept.append((float((speeds / scale).min()), entry))
    if not any(entry.planned for _, entry in kept):
        each = "; ".join(robot.name for robot in robots)
        raise NoAnswerError(
            f"no gait of the table serves all of the robots ({each}): narrow their range of stiffness"
        )
    # images of one gait stay together, forward first; what planners do not use comes last
    kept.sort(key=lambda pair: (not pair[1].planned, -round(pair[0], 3)))
    if len(robots) > 1:
        say(f"{len(kept)} of {len(named)} gaits serve all {len(robots)} robots")
    return GaitTable(robots[0].name, robots[0].fingerprint(), model, tuple(entry for _, entry in kept))


def _allowed(gait: Gait, limits: Limits) -> bool:
    low, high = limits.pressure_kpa
    slow, fast = limits.frequency_hz
    return (
        # limits that are met but for rounding are met
        low - 1e-9 <= gait.pressure_kpa <= high + 1e-9
        and slow <= gait.frequency_hz * (1 + 1e-9)
        and (gait.frequency_hz <= fast * (1 + 1e-9))
    )


def _alike(orbits: tuple[Orbit | NoAnswerError, ...]) -> list[Orbit]:
    """Return the orbits if all are stable and move on the same way and to the same side; else none."""
    moving = [orbit for orbit in orbits if not isinstance(orbit, NoAnswerError)]
    good = [o for o in moving if o.largest_multiplier < 1 and abs(o.speed_m_s) >= TABLE.slowest_replayed_m_s]
    ways = {(o.speed_m_s > 0, _side(o.turn_rate_rad_s)) for o in good}
    return good if len(good) == len(orbits) and len(ways) == 1 else []


def _side(turn_rate_rad_s: float) -> int:
    return 0 if abs(turn_rate_rad_s) < GOAL.straight_rad_s else int(np.sign(turn_rate_rad_s))

"""Entries of gait tables certified by simulation, and moved to another controller's tick."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import casadi as ca

from srs_opt.errors import NoAnswerError
from srs_opt.gait_opt.certificate import certify, self_clearance_m
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.corrections import in_step
from srs_opt.gait_opt.finish import quantized
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.objectives.cycle import GaitCycle
from srs_opt.gait_opt.objectives.objective import Objective
from srs_opt.gait_opt.settings import GOAL
from srs_opt.gait_opt.switch_times import collocated_speeds
from srs_opt.gait_opt.table import EntryCertificate, GaitTable, TableGait
from srs_opt.gait_opt.table_settings import TABLE
from srs_opt.parallel import executor
from srs_opt.parallel.sweep import sweep
from srs_opt.robot import Robot

Say = Callable[[str], None]

# What a table says of a gait is its motion: whether that is what was wished for is decided before.
_ANY_MOTION = Objective("entry", lambda cycle: cycle.speed_m_s, turn="any")


def certified_table(
    robot: Robot,
    table: GaitTable,
    limits: Limits,
    say: Say = lambda text: None,
    *,
    on_other_ticks: bool = False,
    jobs: int = 1,
    cluster: str | None = None,
) -> GaitTable:
    """Return the table with every entry's certificate; entries that fail are left out, and said so.

    Parameters
    ----------
    on_other_ticks : bool
        Put the table on ticks of `limits.tick_s` first: of every entry the gait whose motion is nearest to
        it. Pressure and frequency keep the entry's own as limits where `limits` are narrower.

    Raises
    ------
    NoAnswerError
        If none passes.
    """
    each = _on_ticks if on_other_ticks else _certificate
    work = partial(_every, each, _Work(robot, table.model, limits))
    with executor(jobs, cluster) as where:
        results = list(sweep(work, list(table.gaits), chunk=8, where=where))
    for entry, (kept, line) in zip(table.gaits, results):
        if kept is None:
            say(f"{entry.name}: left out, {line}")
    gaits = tuple(kept for kept, _ in results if kept is not None)
    if not gaits:
        raise NoAnswerError(f"no gait of the table passes its certificate: {results[0][1]}")
    return table.with_gaits(gaits)


@dataclass(frozen=True)
class _Work:
    robot: Robot
    model: str
    limits: Limits


_Each = Callable[[_Work, TableGait], tuple[TableGait | None, str]]


def _every(each: _Each, work: _Work, entries: Sequence[TableGait]) -> list[tuple[TableGait | None, str]]:
    return [each(work, entry) for entry in entries]


def _certificate(work: _Work, entry: TableGait) -> tuple[TableGait | None, str]:
    """Return the entry with its certificate and "", or None and what failed."""
    problem = CycleProblem((work.robot,), work.model, Goal(_ANY_MOTION), work.limits)
    try:
        # what the certificate's simulation has to confirm: it must come from elsewhere
        # (soft bodies have several orbits, and collocation may find one that is not reached from rest)
        soft = work.model == "compliant"
        claimed = (entry.speed_m_s,) if soft else collocated_speeds(problem, entry.gait)
        if claimed is None:
            return None, "collocation does not find its motion"
        if entry.radius_m is not None and abs(entry.radius_m) < work.robot.body_width_m / 2:
            # it turns on the spot: whether its path runs ahead or back is decided by rounding
            claimed = tuple(math.copysign(speed, entry.speed_m_s) for speed in claimed)
        certificate, (orbit,) = certify(problem, entry.gait, claimed)
    except NoAnswerError as error:
        return None, str(error)
    if not certificate.passed:
        return None, "; ".join(certificate.failures)
    found = certificate.robots[0]
    clearance = self_clearance_m(work.robot, orbit, work.model)
    kept = EntryCertificate(
        found.relative_error,
        found.periodicity_gap,
        found.largest_floquet_multiplier,
        found.standing_start_m_s,
        clearance if clearance < float("inf") else None,
    )
    return replace(entry, certificate=kept), ""


def _on_ticks(work: _Work, entry: TableGait) -> tuple[TableGait | None, str]:
    limits, gait = work.limits, entry.gait
    (slow, fast), (weak, strong) = limits.frequency_hz, limits.pressure_kpa
    # an entry's own pressure and frequency count as within the limits
    wide = replace(
        limits,
        frequency_hz=(min(slow, gait.frequency_hz), max(fast, gait.frequency_hz)),
        pressure_kpa=(min(weak, gait.pressure_kpa), max(strong, gait.pressure_kpa)),
    )
    straight = entry.radius_m is None or abs(entry.turn_rate_rad_s) < GOAL.straight_rad_s
    like = Objective("entry", _likeness(entry), turn="any")
    goal = replace(Goal(like), turn_rate_rad_s=0.0) if straight else Goal(like)
    problem = CycleProblem((work.robot,), work.model, goal, wide)
    try:
        near = in_step(quantized(problem, gait), limits.tick_s)
        (orbit,) = certify(problem, near, (entry.speed_m_s,))[1]
    except NoAnswerError as error:
        return None, str(error)
    return _certificate(
        replace(work, limits=wide), replace(TableGait.of_orbit(entry.name, orbit), planned=entry.planned)
    )


def _likeness(entry: TableGait) -> Callable[[GaitCycle], ca.SX]:
    """Return the merit of moving as the entry does, in no wider a band."""
    speed, turn, band = entry.speed_m_s, entry.turn_rate_rad_s, sum(entry.envelope_m)

    def merit(cycle: GaitCycle) -> ca.SX:
        wider = ca.fmax(cycle.band_m - band, 0)
        off = ca.hypot(cycle.speed_m_s - speed, TABLE.lever_m * (cycle.turn_rate_rad_s - turn))
        return -off - TABLE.wider_m_s_per_m * wider

    return merit

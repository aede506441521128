"""A plan as a program for the valve controller: it then runs by itself, without a pilot."""

from __future__ import annotations

from planners.plan.answer import Plan
from planners.search.problem import Problem
from srs_opt.controller.program import ControllerLimits, Program
from srs_opt.gait import Gait


def plan_program(problem: Problem, plan: Plan) -> Program:
    """Return the program of a plan, the joining cycles of its changes of gait included.

    Raises
    ------
    InputError
        If a gait does not stand on the controller's ticks.
    """
    limits = problem.joints.limits
    entries: list[tuple[str, Gait, float, float]] = []
    known: dict[tuple[int, int], int] = {}
    cycles: list[int] = []
    for before, gait in zip((problem.motion.rest, *plan.gaits), plan.gaits):
        plain = problem.joints.is_plain(before, gait)
        key = (gait, gait) if plain else (before, gait)
        if key not in known:
            joint = problem.joints.joint(before, gait)
            assert joint is not None  # it is part of a plan
            entry = problem.gaits.gaits[problem.motion.row(gait)]
            made = f"refined {gait - problem.motion.rest}" if gait > problem.motion.rest else "joining"
            name = entry.name if plain else f"{entry.name} {made}"
            known[key] = len(entries)
            entries.append((name, joint.gait, entry.speed_m_s, entry.turn_rate_rad_s))
        cycles.append(known[key])
    controller = ControllerLimits(dwell_s=limits.min_dwell_s, slew_kpa_s=limits.pressure_rate_kpa_s)
    return Program.of_cycles(problem.robot.name, cycles, entries, limits.tick_s, controller)

"""Sensitivity of the optimum to its active limits: their multipliers, in physical units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from srs_opt.gait_opt.collocation.layout import ENVELOPE_UNIT_M, PRESSURE_UNIT_KPA
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.collocation.program import Program, Solution
from srs_opt.gait_opt.settings import REPORT


@dataclass(frozen=True)
class Price:
    """What a small change of one limit would bring.

    Attributes
    ----------
    limit : str
        In words, as "the least pressure".
    change, unit : float, str
        A small step by which to relax it (negative: lower it).
    merit : float
        Merit gained by that step, to first order.
    words : str
        The same in words, in the objective's own unit.
    """

    limit: str
    change: float
    unit: str
    merit: float
    words: str

    def record(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {
            "limit": self.limit,
            "change": self.change,
            "unit": self.unit,
            "merit": self.merit,
            "words": self.words,
        }


def prices(problem: CycleProblem, p: Program, solution: Solution, merit_unit: float) -> tuple[Price, ...]:
    """Return the prices of the active limits at a solution, the costliest limit first.

    The solvers make minus the merit (in units of `merit_unit`) small, so a bound's multiplier (negative at a
    lower bound, positive at an upper one) times that unit is what the merit gains per unit of the bound.
    """
    layout, goal, limits = p.layout, problem.goal, problem.limits
    by_z, z = merit_unit * solution.multipliers_z, solution.z
    found: list[tuple[str, float, str, float]] = []
    scaled = (
        ("frequency", 0, 1.0, limits.frequency_hz, 0.1, "Hz"),
        ("pressure", 1, PRESSURE_UNIT_KPA, limits.pressure_kpa, 1.0, "kPa"),
    )
    for name, place, unit, (low, high), step, word in scaled:
        for which, bound, sign in (("least", low, -1.0), ("highest", high, 1.0)):
            at_limit = abs(unit * z[place] - bound) < REPORT.at_limit * max(bound, 1.0)
            if at_limit and low < high and sign * by_z[place] > 0:
                found.append((f"the {which} {name}", sign * step, word, sign * step * by_z[place] / unit))
    speeds = [layout.unknown(r, "speed") for r in range(len(problem.robots))]
    if goal.floor_m_s is not None:
        found.append(("the least speed", -0.01, "m/s", -0.01 * float(by_z[speeds].sum())))
    if goal.turn_rate_rad_s:
        at = float(by_z[layout.unknown(0, "turn_rate")])
        found.append(("the wanted turn rate", float(np.sign(at)) * 0.1, "rad/s", 0.1 * abs(at)))
    found += _of_rows(problem, p, solution, merit_unit)
    worth = [Price(*price, _words(problem, *price)) for price in found if price[3] > REPORT.least_price]
    return tuple(sorted(worth, key=lambda price: -price.merit))


def of_ticks(problem: CycleProblem, merit: float) -> Price:
    """Return what the controller's tick costs: the merit by which a gait between ticks is better."""
    aim, tick_ms = problem.goal.aim, 1e3 * problem.limits.tick_s
    cost = f"{merit * aim.unit_per_merit:.2g} {aim.unit or 'merit'}"
    words = f"a tick of {tick_ms:g} ms costs {cost} against switches at any time"
    return Price("the tick", -tick_ms, "ms", merit, words)


def _of_rows(
    problem: CycleProblem, p: Program, solution: Solution, merit_unit: float
) -> list[tuple[str, float, str, float]]:
    """Return the prices of rows: dwell, band, radius, own constraints, curvature."""
    size = len(p.goal.names)
    by_row = merit_unit * solution.multipliers_g[-size:]
    names = np.array(p.goal.names)

    def total(name: str) -> float:
        return float(by_row[names == name].sum())

    found = [
        # rows are length - dwell f >= 0, so 1 ms less dwell relaxes each by 1e-3 f
        ("the least time between switches", -1.0, "ms", -1e-3 * total("dwell") * float(solution.z[0])),
        ("the widest band", 1.0, "mm", -1e-3 * total("envelope") / ENVELOPE_UNIT_M),
    ]
    if problem.goal.radius_m is not None:
        turn = float(solution.z[p.layout.unknown(0, "turn_rate")])
        # the row is speed - radius x turn rate = 0
        at = float(by_row[names == "radius"][0]) * turn
        found.append(("the wanted radius", float(np.sign(at)) * 10.0, "mm", 0.01 * abs(at)))
    found += [
        (f"the constraint {name}", 0.01, "", 0.01 * float(np.abs(by_row[names == name]).sum()))
        for name in dict.fromkeys(problem.formulas.names)
    ]
    if problem.limits.max_curvature_1_m is not None:
        path = sum(float(np.abs(part).sum()) for part in _curvature_rows(p, solution.multipliers_g))
        found.append(("the largest curvature", 0.1, "1/m", 0.1 * merit_unit * path))
    return found


def _curvature_rows(p: Program, multipliers: np.ndarray) -> list[np.ndarray]:
    """Return the multipliers of every robot's curvature rows, the last ones of its block."""
    found, start = [], 0
    for kind, count in zip(p.layout.kinds, p.row_counts):
        start += count
        rows = p.layout.elements * kind.segments if kind.curvature else 0
        found.append(multipliers[start - rows : start])
    return found


def _words(problem: CycleProblem, limit: str, change: float, unit: str, merit: float) -> str:
    aim = problem.goal.aim
    gain = f"{merit * aim.unit_per_merit:.2g} {aim.unit or 'merit'}"
    step = f"{abs(change):g}{' ' + unit if unit else ''}"
    if limit.startswith("the constraint"):
        return f"{limit} relaxed by {step} would buy {gain}"
    return f"{limit} {'lowered' if change < 0 else 'raised'} by {step} would buy {gain}"

"""Solver failures in the model's terms: which state or limit, at which time, by how much."""

from __future__ import annotations

import numpy as np

from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.layout import DEGREE
from srs_opt.gait_opt.collocation.point import BODY, BODY_NAMES, PointKind
from srs_opt.gait_opt.collocation.program import Program, Solution

_WORDS = {
    "Maximum_Iterations_Exceeded": "stopped at the iteration limit",
    "Infeasible_Problem_Detected": "no gait near this one meets all limits",
    "Restoration_Failed": "could not get back to the equations of motion",
    "User_Requested_Stop": "interrupted",
    "Invalid_Number_Detected": "the equations of motion gave a number that is not finite",
}


def explained(p: Program, solution: Solution, gait: Gait) -> str:
    """Return what went wrong, beginning with a semicolon; empty if nothing did."""
    if solution.converged:
        return ""
    word = _WORDS.get(solution.status, solution.status.replace("_", " ").lower())
    if not np.isfinite(solution.rows).all():
        return f"; {word}"
    return f"; {word}: {worst_equation(p, solution.rows, gait)}"


def worst_equation(p: Program, rows: np.ndarray, gait: Gait) -> str:
    """Return the equation of motion that is met worst, as robot, state, time and scaled size."""
    worst, text = -1.0, ""
    start = 0
    for robot, kind in enumerate(p.layout.kinds):
        n = kind.states * p.layout.points
        residual = np.abs(rows[start : start + n]).reshape(p.layout.points, kind.states)
        start += p.row_counts[robot]
        point, state = np.unravel_index(int(residual.argmax()), residual.shape)
        if residual[point, state] > worst:
            worst = float(residual[point, state])
            name = BODY_NAMES[state] if state < BODY else _shape_name(int(state) - BODY, kind)
            element = int(point) // DEGREE
            when = element / p.layout.elements * gait.period_s
            text = f"{name} about {when:.3f} s into the cycle, off by {worst:.1e} of its size"
            text += f" (robot {robot + 1})" if len(p.layout.kinds) > 1 else ""
    return text


def _shape_name(index: int, kind: PointKind) -> str:
    bends = ("bend", "bend rate") if kind.bends else ()
    names = (*bends, "curvature", "curvature rate", "hysteresis")
    return f"{names[min(index // kind.segments, len(names) - 1)]} of segment {index % kind.segments + 1}"

"""From exact switch times to the controller's ticks: rounded, then searched tick by tick, simulated."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from srs_opt.manoeuvre.settings import MANOEUVRE_SEARCH
from srs_opt.manoeuvre.solve import Candidate, Solver
from srs_opt.manoeuvre.valves import COINCIDENT_S, ValvePlan, ValveRow


def on_ticks(solver: Solver, plan: ValvePlan) -> Candidate:
    """Return the best manoeuvre on whole ticks near a plan."""
    bounds = solver.task.bounds
    tick = bounds.tick_s
    rounded = _rounded(plan, tick, round(bounds.dwell_s / tick))
    begun = [_lengthened(rounded, k * tick) for k in range(MANOEUVRE_SEARCH.tick_lengths)]
    best = min(solver.judge([p for p in begun if solver.plays(p)] or [rounded]), key=lambda c: c.merit)
    for _ in range(MANOEUVRE_SEARCH.tick_rounds):
        trials = [p for p in _neighbours(best.plan, tick) if solver.plays(p)]
        found = min(solver.judge(trials), key=lambda c: c.merit, default=best)
        # gains of a microsecond are the integration's
        if found.merit >= best.merit - 1e-6:
            break
        best = found
    return best


def _rounded(plan: ValvePlan, tick: float, dwell: int) -> ValvePlan:
    rows = []
    for row in plan.rows:
        ticks = [round(t / tick) for t in row.times_s]
        for k, (one, other) in enumerate(pairwise(ticks)):
            ticks[k + 1] = max(other, one + dwell, ticks[k] + dwell)
        rows.append(ValveRow(row.states, tuple(k * tick for k in ticks)))
    end = max(
        int(np.ceil(plan.duration_s / tick - 1e-6)),
        *(round(r.times_s[-1] / tick) for r in rows if r.times_s),
        1,
    )
    return replace(plan, rows=tuple(rows), duration_s=end * tick).trimmed()


def _lengthened(plan: ValvePlan, by_s: float) -> ValvePlan:
    return replace(plan, duration_s=plan.duration_s + by_s)


def _neighbours(plan: ValvePlan, tick: float) -> list[ValvePlan]:
    times = plan.times()
    found = [plan.with_times(times, plan.duration_s + d * tick, plan.pressure_kpa) for d in (-1, 1)]
    for k in range(times.size):
        for d in (-1, 1):
            moved = times.copy()
            moved[k] = round(moved[k] / tick + d) * tick
            if moved[k] > COINCIDENT_S and moved[k] < plan.duration_s - COINCIDENT_S:
                found.append(plan.with_times(moved, plan.duration_s, plan.pressure_kpa))
    return found

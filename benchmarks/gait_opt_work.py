"""The optimizer's own work: cold and warm, one on-interval and two, valves free against the wave."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

import numpy as np

from benchmarks.section import Section
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.free import search_free
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.search import Found, search
from srs_opt.robot import wpi_srs

PROBLEM = CycleProblem((wpi_srs(),), "complex", Goal("speed"), Limits())
BAND = replace(PROBLEM, goal=Goal("speed", envelope_m=0.085))
BENT = replace(PROBLEM, limits=Limits(pressure_kpa=(30.0, 55.0), max_curvature_1_m=10.0))
MOVED = {
    "least pressure 10 % up": (PROBLEM, {"pressure_kpa": (45.1, 55.0)}),
    "largest frequency 10 % down": (PROBLEM, {"frequency_hz": (1.0, 1.8)}),
    "least pressure 10 % down": (PROBLEM, {"pressure_kpa": (36.9, 55.0)}),
    "largest frequency 10 % up": (PROBLEM, {"frequency_hz": (1.0, 2.2)}),
    "both ranges 10 % up": (PROBLEM, {"frequency_hz": (1.1, 2.2), "pressure_kpa": (45.1, 60.5)}),
    "both ranges 10 % down": (PROBLEM, {"frequency_hz": (0.9, 1.8), "pressure_kpa": (36.9, 49.5)}),
    "dwell 10 % up": (PROBLEM, {"min_dwell_s": 0.022}),
    "largest curvature, 10 1/m, 10 % down": (BENT, {"max_curvature_1_m": 9.0}),
    "largest curvature, 10 1/m, 10 % up": (BENT, {"max_curvature_1_m": 11.0}),
    "band, 85 mm, 10 % down": (BAND, {"envelope_m": 0.0765}),
    "band, 85 mm, 10 % up": (BAND, {"envelope_m": 0.0935}),
}
T = TypeVar("T")
COLUMNS = ["", "speed m/s", "off certificate", "switches per s", "shortest dwell s", "processor s", "of cold"]


def run(quick: bool) -> Section:
    search(PROBLEM, 1)  # libraries load, equations compile
    starts = 1 if quick else 4
    first, cold_s = _timed(partial(search, PROBLEM, starts))
    rows = [_row(f"cold, {starts} starts", first, cold_s)]
    earlier = {PROBLEM: first}
    shares, lost = [], []
    for name, (before, changes) in (dict(list(MOVED.items())[:1]) if quick else MOVED).items():
        if before not in earlier:
            earlier[before] = search(before, starts)
        problem = _moved(before, changes)
        search(problem, 1)
        again, again_s = _timed(partial(search, problem, starts))
        found, seconds = _timed(partial(search, problem, warm=earlier[before].gait))
        shares.append(seconds / again_s)
        lost.append(1 - found.certificate.speed_m_s / again.certificate.speed_m_s)
        rows += [_row(f"warm, {name}", found, seconds, shares[-1]), _row("  the same cold", again, again_s)]
    notes = [
        "Warm: from the earlier result alone, one limit moved (nothing but speed unless told). Certified "
        f"speeds. A warm repeat takes {np.median(shares):.2f} of the same search cold in the median "
        f"({min(shares):.2f} to {max(shares):.2f}); the most speed that one lost is {100 * max(lost):.2f} %."
    ]
    for intervals in () if quick else (1, 2):
        freed, seconds = _timed(partial(search_free, replace(PROBLEM, intervals=intervals), 1))
        rows.append(_row(f"valves free, {intervals} on-intervals", freed.rounded or freed.found, seconds))
        gain = 100 * (freed.record()["gain"] or 0.0)
        notes.append(
            f"Valves free, K = {intervals}: relaxed, {freed.relaxation.speed_m_s:.4f} m/s at friction "
            f"smoothed to 0.01 m/s; rounded and optimized, {gain:+.2f} % against the wave."
        )
    ratios = {"warm over cold": float(np.median(shares))}
    return Section("Gait optimization: warm repeats, free valves", COLUMNS, rows, notes, ratios)


def _moved(problem: CycleProblem, changes: dict[str, Any]) -> CycleProblem:
    if "envelope_m" in changes:
        return replace(problem, goal=replace(problem.goal, **changes))
    return replace(problem, limits=replace(problem.limits, **changes))


def _timed(work: Callable[[], T]) -> tuple[T, float]:
    started = time.process_time()
    return work(), time.process_time() - started


def _row(name: str, found: Found, seconds: float, share: float | None = None) -> list[str]:
    c = found.certificate
    return [
        name,
        f"{c.speed_m_s:.4f}" + ("" if c.passed else " (FAILED)"),
        f"{100 * c.relative_error:.3f} %",
        f"{c.switches_per_s:.0f}",
        f"{found.gait.shortest_dwell_s():.3f}",
        f"{seconds:.2f}",
        "" if share is None else f"{share:.2f}",
    ]

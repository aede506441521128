"""The optimizer's own work: cold and warm, one on-interval and two, valves free against the wave."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TypeVar

from benchmarks.section import Section
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.free import search_free
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.search import Found, search
from srs_opt.robot import wpi_srs

PROBLEM = CycleProblem((wpi_srs(),), "complex", Goal("speed"), Limits())
MOVED = {
    "least pressure 10 % up": Limits(pressure_kpa=(45.1, 55.0)),
    "largest frequency 10 % down": Limits(frequency_hz=(1.0, 1.8)),
    "least pressure 10 % down": Limits(pressure_kpa=(36.9, 55.0)),
    "both ranges 10 % up": Limits((1.1, 2.2), (45.1, 60.5)),
}
T = TypeVar("T")
COLUMNS = ["", "speed m/s", "off certificate", "switches per s", "shortest dwell s", "processor s"]


def run(quick: bool) -> Section:
    first, cold_s = _timed(partial(search, PROBLEM))
    rows = [_row("cold, four starts", first, cold_s)]
    moved = dict(list(MOVED.items())[:2]) if quick else MOVED
    warm_s = []
    for name, limits in moved.items():
        problem = replace(PROBLEM, limits=limits)
        found, seconds = _timed(partial(search, problem, warm=first.gait))
        warm_s.append(seconds)
        rows.append(_row(f"warm, {name}", found, seconds))
        if not quick:
            again, seconds = _timed(partial(search, problem))
            rows.append(_row("  the same cold", again, seconds))
    notes = ["Warm: from the first result alone, limits moved. Certified speeds; all pass."]
    for intervals in () if quick else (1, 2):
        freed, seconds = _timed(partial(search_free, replace(PROBLEM, intervals=intervals), 1))
        rows.append(_row(f"valves free, {intervals} on-intervals", freed.rounded or freed.found, seconds))
        gain = 100 * (freed.record()["gain"] or 0.0)
        notes.append(
            f"Valves free, K = {intervals}: relaxed, {freed.relaxation.speed_m_s:.4f} m/s at friction "
            f"smoothed to 0.01 m/s; rounded and optimized, {gain:+.2f} % against the wave."
        )
    ratios = {"warm over cold": sum(warm_s) / len(warm_s) / cold_s}
    return Section("Gait optimization: warm repeats, free valves", COLUMNS, rows, notes, ratios)


def _timed(work: Callable[[], T]) -> tuple[T, float]:
    started = time.process_time()
    return work(), time.process_time() - started


def _row(name: str, found: Found, seconds: float) -> list[str]:
    c = found.certificate
    return [
        name,
        f"{c.speed_m_s:.4f}" + ("" if c.passed else " (FAILED)"),
        f"{100 * c.relative_error:.3f} %",
        f"{c.switches_per_s:.0f}",
        f"{found.gait.shortest_dwell_s():.3f}",
        f"{seconds:.1f}",
    ]

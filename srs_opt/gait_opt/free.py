"""Valves without a given pattern: relax to [-1, 1], collocate, round with dwell times, then switch times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.guess import unknowns_from_orbits
from srs_opt.gait_opt.collocation.layout import PRESSURE_UNIT_KPA, Mesh
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.finish import topped
from srs_opt.gait_opt.ladder import Rung, bounded, climb, orbits_of
from srs_opt.gait_opt.score import score
from srs_opt.gait_opt.search import HERE, Found, Where, search

ELEMENTS = 40  # of the relaxed problem; valve levels have the same grid
SMOOTHED_M_S = 0.01
_IPOPT = {"mu_strategy": "monotone", "mu_init": 1e-2, "max_iter": 200}
_PULLED = 0.8  # size of the first guess's valve levels, off their bounds
_FINE = 25  # places per element for rounding


@dataclass(frozen=True)
class Relaxation:
    """The relaxed optimum: speed and valve levels (elements, N-1) at one friction smoothing speed."""

    speed_m_s: float
    levels: np.ndarray
    frequency_hz: float
    pressure_kpa: float
    converged: bool


@dataclass(frozen=True)
class FreeResult:
    """What freeing the valves brought.

    Attributes
    ----------
    found : Found
        The better of wave and rounded gait, with its certificate.
    wave_m_s : float
        Speed of the wave gait.
    rounded : Found or None
        The best gait with K intervals (None: none was found).
    rounded_intervals : tuple of int
        Intervals per segment after rounding, before any were added to make K.
    relaxation : Relaxation
    """

    found: Found
    wave_m_s: float
    rounded: Found | None
    rounded_intervals: tuple[int, ...]
    relaxation: Relaxation

    def record(self) -> dict[str, Any]:
        """Return what the command adds to its JSON."""
        best = self.rounded
        speed = None if best is None else best.certificate.speed_m_s
        return {
            "wave_speed_m_s": self.wave_m_s,
            "speed_m_s": speed,
            "gain": None if speed is None else speed / self.wave_m_s - 1,
            "relaxed_speed_m_s": self.relaxation.speed_m_s,
            "relaxed_friction_speed_m_s": SMOOTHED_M_S,
            "intervals_after_rounding": list(self.rounded_intervals),
            "switches_per_s": None if best is None else best.gait.switches_per_s,
            "shortest_dwell_s": None if best is None else best.gait.shortest_dwell_s(),
        }


def search_free(
    problem: CycleProblem,
    starts: int = 4,
    seed: int = 0,
    say: Callable[[str], None] = lambda text: None,
    *,
    where: Where = HERE,
) -> FreeResult:
    """Return the best gait with at most ``problem.intervals`` on-intervals per segment and cycle."""
    wave = search(replace(problem, intervals=1), starts, seed, say, where=where)
    relaxation = relax(problem, wave.gait)
    at_limits = 100 * np.mean(np.abs(relaxation.levels) > 0.95)
    say(
        f"valves relaxed to [-1, 1]: {relaxation.speed_m_s:.4f} m/s with friction smoothed at "
        f"{SMOOTHED_M_S:g} m/s, {at_limits:.0f} % of the levels at their limits"
    )
    gait, counts = rounded(relaxation, problem)
    candidates = [gait]
    if problem.intervals > 1:
        candidates.append(_wave_with_notches(problem, wave.gait))
    best, free = wave, None
    for candidate in candidates:
        found = _refined(problem, candidate, wave, say)
        if found is None:
            continue
        if free is None or _total(problem, found) > _total(problem, free):
            free = found
        if found.certificate.passed and _total(problem, found) > _total(problem, best):
            best = found
    return FreeResult(best, wave.certificate.speed_m_s, free, counts, relaxation)


def _total(problem: CycleProblem, found: Found) -> float:
    return score(problem, found.gait, found.orbits).total


def _refined(problem: CycleProblem, gait: Gait, wave: Found, say: Callable[[str], None]) -> Found | None:
    """Take one on/off gait up the last rungs and optimize its switch times exactly."""
    own = max(r.friction_speed_m_s for r in problem.robots)
    rungs = (Rung(SMOOTHED_M_S, 60, 0.05, 6), Rung(max(own, 0.004), 70, 0.03, 3), Rung(own, 80, 0.02, 2))
    try:
        top = climb(problem, gait, rungs)
        exact, certificate, orbits = topped(problem, top.gait, 0.01)
    except NoAnswerError as error:
        say(f"a rounded gait leads nowhere: {error}")
        return None
    say(
        f"{problem.intervals} intervals per segment: {certificate.speed_m_s:.4f} m/s with "
        f"{certificate.switches_per_s:.0f} switches per s; the wave makes "
        f"{wave.certificate.speed_m_s:.4f} m/s with {wave.certificate.switches_per_s:.0f}"
    )
    return replace(
        wave,
        gait=orbits[0].gait,
        orbits=orbits,
        certificate=certificate,
        steps=(*top.steps, *exact.steps),
        iterations=wave.iterations + top.iterations + sum(s.iterations for s in exact.steps),
    )


def _wave_with_notches(problem: CycleProblem, gait: Gait) -> Gait:
    period = gait.period_s
    width = 1.5 * max(problem.limits.min_dwell_s, 2 * problem.limits.tick_s) / period
    rows = []
    for ((on, off),) in gait.intervals:
        pulse = (on / period, (on + (off - on) % period) / period)
        pulses = notched([pulse], width, problem.intervals)
        rows.append(tuple((a % 1.0 * period, b % 1.0 * period) for a, b in pulses))
    return Gait(period, gait.pressure_kpa, tuple(rows))


def relax(problem: CycleProblem, gait: Gait) -> Relaxation:
    """Return the optimum with valve levels in [-1, 1], from the neighbourhood of `gait`."""
    loose = replace(problem, relaxed=True)
    mesh = Mesh.uniform(ELEMENTS)
    p = loose.program(ELEMENTS)
    orbits = orbits_of(problem, gait, SMOOTHED_M_S)
    z, scales = unknowns_from_orbits(p.layout, list(problem.robots), list(orbits), mesh)
    levels = slice(2, 2 + p.layout.switches)
    z[levels] *= _PULLED
    z[p.layout.merit] = score(problem, gait, orbits).merit
    unknowns, rows, _ = bounded(loose, p, z, 2.0)
    solution = p.solve(z, loose.parameters(p, mesh, scales, SMOOTHED_M_S), unknowns, rows, options=_IPOPT)
    return Relaxation(
        float(solution.z[p.layout.unknown(0, "speed")]),
        solution.z[levels].reshape(ELEMENTS, -1),
        float(solution.z[0]),
        float(PRESSURE_UNIT_KPA * solution.z[1]),
        solution.converged,
    )


def rounded(relaxation: Relaxation, problem: CycleProblem) -> tuple[Gait, tuple[int, ...]]:
    """Return an on/off gait near the relaxed one, and how many intervals rounding gave each segment.

    Sum-up rounding keeps the integral of the valve within one step; pulses shorter than the dwell time, and
    the shortest ones beyond K, are dropped; where fewer than K are left, notches of the dwell time fill up.
    """
    period = 1 / relaxation.frequency_hz
    dwell = max(problem.limits.min_dwell_s, 2 * problem.limits.tick_s) / period
    rows, counts = [], []
    for levels in relaxation.levels.T:
        on = sum_up(np.repeat(levels, _FINE))
        pulses = merged(intervals_of(on), 1.05 * dwell, problem.intervals)
        counts.append(len(pulses))
        pulses = notched(pulses, 1.5 * dwell, problem.intervals)
        rows.append(tuple((a % 1.0 * period, b % 1.0 * period) for a, b in pulses))
    return Gait(period, relaxation.pressure_kpa, tuple(rows)), tuple(counts)


def sum_up(levels: np.ndarray) -> np.ndarray:
    """Return the on/off sequence (True: +1) whose running sum follows that of `levels`."""
    owed, on = 0.0, np.zeros(levels.size, dtype=bool)
    for k, level in enumerate(levels):
        owed += level
        on[k] = owed >= 0
        owed -= 1.0 if on[k] else -1.0
    return on


def intervals_of(on: np.ndarray) -> list[tuple[float, float]]:
    """Return the cyclic on-intervals as (start, end) fractions of the cycle, starts in [0, 1)."""
    edges = np.flatnonzero(on != np.roll(on, 1))
    if not edges.size:
        return [(0.0, 0.5)]  # a valve that never switches: the wave's half cycle, for want of anything
    first = next(k for k, e in enumerate(edges) if on[e])
    places = np.roll(edges, -first) / on.size
    pairs = [(places[k], places[k + 1]) for k in range(0, places.size, 2)]
    return [(float(a), float(b if b > a else b + 1)) for a, b in pairs]


def merged(pulses: list[tuple[float, float]], least: float, most: int) -> list[tuple[float, float]]:
    """Drop pulses and close gaps, shortest first, until all last `least` and at most `most` remain."""
    pulses = sorted(pulses)
    while len(pulses) > 1:
        gaps = [(pulses[(k + 1) % len(pulses)][0] - b) % 1.0 for k, (_, b) in enumerate(pulses)]
        lengths = [b - a for a, b in pulses]
        shortest = min(min(gaps), min(lengths))
        if shortest >= least and len(pulses) <= most:
            break
        if min(lengths) <= min(gaps):
            pulses.pop(int(np.argmin(lengths)))
        else:
            k = int(np.argmin(gaps))
            following = pulses[(k + 1) % len(pulses)]
            end = following[1] if following[0] >= pulses[k][0] else following[1] + 1
            pulses[k] = (pulses[k][0], end)
            pulses.pop((k + 1) % len(pulses))
    a, b = pulses[0]
    if len(pulses) == 1 and not least <= b - a <= 1 - least:
        pulses = [(a, a + float(np.clip(b - a, least, 1 - least)))]
    return pulses


def notched(pulses: list[tuple[float, float]], width: float, count: int) -> list[tuple[float, float]]:
    """Cut gaps of `width` into the longest pulses until there are `count`."""
    pulses = list(pulses)
    while len(pulses) < count:
        k = int(np.argmax([b - a for a, b in pulses]))
        a, b = pulses[k]
        middle = (a + b) / 2
        pulses[k : k + 1] = [(a, middle - width / 2), (middle + width / 2, b)]
    return pulses

"""Valves without a given pattern: relax to [-1, 1], collocate, round with dwell times, then switch times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from srs_opt.errors import InputError, NoAnswerError
from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.guess import unknowns_from_orbits
from srs_opt.gait_opt.collocation.layout import PRESSURE_UNIT_KPA, Mesh
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.continuation import Stage, bounded, orbits_of, run_stages
from srs_opt.gait_opt.finish import finished
from srs_opt.gait_opt.score import score
from srs_opt.gait_opt.search import HERE, Found, Where, search
from srs_opt.gait_opt.search_settings import FREE_VALVES

_IPOPT = {"mu_strategy": "monotone", "mu_init": 1e-2, "max_iter": 200}


@dataclass(frozen=True)
class Relaxation:
    """The relaxed optimum: speed and valve levels (elements, N-1) at one friction smoothing speed."""

    speed_m_s: float
    levels: np.ndarray
    frequency_hz: float
    pressure_kpa: float
    converged: bool


@dataclass(frozen=True)
class Repeated:
    """The best wave at `repeats` times the frequency, which K >= `repeats` pulses per cycle can play."""

    repeats: int
    frequency_hz: float
    speed_m_s: float


@dataclass(frozen=True)
class FreeResult:
    """What freeing the valves brought.

    Attributes
    ----------
    found : Found
        The best gait with at most K intervals, waves included, with its certificate.
    waves : tuple of Repeated
        Once, twice ... K times per cycle, as far as dwell times allow; the first is the wave itself.
    free : Found or None
        The best gait that was not merely a repeated wave when its optimization began (None: none was found).
    rounded_intervals : tuple of int
        Intervals per segment after rounding, before any were added to make K.
    relaxation : Relaxation or None
        None where the objective has no relaxed form.
    """

    found: Found
    waves: tuple[Repeated, ...]
    free: Found | None
    rounded_intervals: tuple[int, ...]
    relaxation: Relaxation | None

    def record(self) -> dict[str, Any]:
        """Return what the command adds to its JSON."""
        best, wave = self.found.certificate.speed_m_s, self.waves[0].speed_m_s
        fastest = max(w.speed_m_s for w in self.waves)
        relaxation = self.relaxation
        return {
            "wave_speed_m_s": wave,
            "speed_m_s": best,
            "gain": best / wave - 1,
            "repeated_waves": [asdict(w) for w in self.waves],
            "gain_beyond_frequency": best / fastest - 1,
            "rounded_speed_m_s": None if self.free is None else self.free.certificate.speed_m_s,
            "relaxed_speed_m_s": None if relaxation is None else relaxation.speed_m_s,
            "relaxed_friction_speed_m_s": FREE_VALVES.friction_speed_m_s,
            "intervals_after_rounding": list(self.rounded_intervals),
            "switches_per_s": self.found.gait.switches_per_s,
            "shortest_dwell_s": self.found.gait.shortest_dwell_s(),
        }


def search_free(
    problem: CycleProblem,
    starts: int = 4,
    seed: int = 0,
    say: Callable[[str], None] = lambda text: None,
    *,
    where: Where = HERE,
) -> FreeResult:
    """Return the best gait with at most ``problem.intervals`` on-intervals per segment and cycle.

    The candidates: waves repeated k times per cycle for every k up to K, the relaxed optimum rounded, and a
    wave with notches; each then gets its switch times optimized with as many intervals as it has.
    """
    wave = search(replace(problem, intervals=1), starts, seed, say, where=where)
    waves = [Repeated(1, wave.gait.frequency_hz, wave.certificate.speed_m_s)]
    candidates: list[tuple[int, Gait]] = []
    for repeats in range(2, problem.intervals + 1):
        quicker = _quicker(problem, repeats)
        if quicker is None:
            say(f"no {repeats} pulses per cycle: dwell times leave no room")
            break
        say(f"waves {repeats} times per cycle: up to {quicker.limits.frequency_hz[1]:g} Hz")
        found = search(quicker, starts, seed, say, where=where)
        waves.append(Repeated(repeats, found.gait.frequency_hz, found.certificate.speed_m_s))
        candidates.append((repeats, repeated(found.gait, repeats)))
    best = wave
    for repeats, gait in candidates:
        best = _better(problem, best, _refined(replace(problem, intervals=repeats), gait, wave, say))
    relaxation: Relaxation | None = None
    counts: tuple[int, ...] = ()
    own: list[Gait] = []
    if not (problem.formulas.uses_switches or problem.formulas.uses_curvature):
        relaxation = relax(problem, wave.gait)
        at_limits = 100 * np.mean(np.abs(relaxation.levels) > 0.95)
        say(
            f"valves relaxed to [-1, 1]: {relaxation.speed_m_s:.4f} m/s with friction smoothed at "
            f"{FREE_VALVES.friction_speed_m_s:g} m/s, {at_limits:.0f} % of the levels at their limits"
        )
        gait, counts = on_off_near(relaxation, problem)
        own.append(gait)
    if problem.intervals > 1:
        own.append(_wave_with_notches(problem, wave.gait))
    free = None
    for gait in own:
        refined = _refined(problem, gait, wave, say)
        best = _better(problem, best, refined)
        if refined is not None and (free is None or _total(problem, refined) > _total(problem, free)):
            free = refined
    return FreeResult(best, tuple(waves), free, counts, relaxation)


def _quicker(problem: CycleProblem, repeats: int) -> CycleProblem | None:
    """Return the problem of a wave that is played `repeats` times per cycle; None where no dwell fits."""
    low, high = problem.limits.frequency_hz
    try:
        limits = replace(problem.limits, frequency_hz=(repeats * low, repeats * high))
    except InputError:
        return None
    return replace(problem, intervals=1, limits=limits)


def repeated(gait: Gait, repeats: int) -> Gait:
    """Return one cycle of the same motion that holds the gait's cycle `repeats` times."""
    period = gait.period_s
    rows = tuple(
        tuple(
            ((on + k * period) % (repeats * period), (off + k * period) % (repeats * period))
            for k in range(repeats)
            for on, off in ((a, a + (b - a) % period) for a, b in pairs)
        )
        for pairs in gait.intervals
    )
    return Gait(repeats * period, gait.pressure_kpa, rows)


def _better(problem: CycleProblem, best: Found, found: Found | None) -> Found:
    if found is None or not found.certificate.passed:
        return best
    return found if _total(problem, found) > _total(problem, best) else best


def _total(problem: CycleProblem, found: Found) -> float:
    return score(problem, found.gait, found.orbits).total


def _refined(problem: CycleProblem, gait: Gait, wave: Found, say: Callable[[str], None]) -> Found | None:
    """Take one on/off gait up the last stages and optimize its switch times exactly."""
    own = max(r.friction_speed_m_s for r in problem.robots)
    stages = tuple(Stage(max(own, v), n, reach, most) for v, n, reach, most in FREE_VALVES.stages)
    try:
        top = run_stages(problem, gait, stages)
        exact, certificate, orbits = finished(problem, top.gait, FREE_VALVES.reach)
    except NoAnswerError as error:
        say(f"a rounded gait was dropped: {error}")
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
        prices=exact.prices,
        steps=(*top.steps, *exact.steps),
        iterations=wave.iterations + top.iterations + sum(s.iterations for s in exact.steps),
    )


def _wave_with_notches(problem: CycleProblem, gait: Gait) -> Gait:
    period = gait.period_s
    width = FREE_VALVES.notch_dwells * max(problem.limits.min_dwell_s, 2 * problem.limits.tick_s) / period
    rows = []
    for ((on, off),) in gait.intervals:
        pulse = (on / period, (on + (off - on) % period) / period)
        pulses = notched([pulse], width, problem.intervals)
        rows.append(tuple((a % 1.0 * period, b % 1.0 * period) for a, b in pulses))
    return Gait(period, gait.pressure_kpa, tuple(rows))


def relax(problem: CycleProblem, gait: Gait) -> Relaxation:
    """Return the optimum with valve levels in [-1, 1], from the neighbourhood of `gait`."""
    loose = replace(problem, relaxed=True)
    mesh = Mesh.uniform(FREE_VALVES.elements)
    p = loose.program(FREE_VALVES.elements)
    orbits = orbits_of(problem, gait, FREE_VALVES.friction_speed_m_s)
    z, scales = unknowns_from_orbits(p.layout, list(problem.robots), list(orbits), mesh)
    levels = slice(2, 2 + p.layout.switches)
    # off the bounds, where an interior-point method has room
    z[levels] *= FREE_VALVES.first_level
    z[p.layout.merit] = score(problem, gait, orbits).merit
    unknowns, rows, _ = bounded(loose, p, z, 2.0)
    solution = p.solve(
        z,
        loose.parameters(p, mesh, scales, FREE_VALVES.friction_speed_m_s),
        unknowns,
        rows,
        options=_IPOPT,
        solver=problem.solver,
    )
    return Relaxation(
        float(solution.z[p.layout.unknown(0, "speed")]),
        solution.z[levels].reshape(FREE_VALVES.elements, -1),
        float(solution.z[0]),
        float(PRESSURE_UNIT_KPA * solution.z[1]),
        solution.converged,
    )


def on_off_near(relaxation: Relaxation, problem: CycleProblem) -> tuple[Gait, tuple[int, ...]]:
    """Return an on/off gait near the relaxed one, and how many intervals rounding gave each segment.

    Sum-up rounding keeps the integral of the valve within one step; pulses shorter than the dwell time, and
    the shortest ones beyond K, are dropped; where fewer than K are left, notches of the dwell time fill up.
    """
    period = 1 / relaxation.frequency_hz
    dwell = max(problem.limits.min_dwell_s, 2 * problem.limits.tick_s) / period
    rows, counts = [], []
    for levels in relaxation.levels.T:
        on = sum_up(np.repeat(levels, FREE_VALVES.places))
        pulses = merged(intervals_of(on), FREE_VALVES.least_dwells * dwell, problem.intervals)
        counts.append(len(pulses))
        pulses = notched(pulses, FREE_VALVES.notch_dwells * dwell, problem.intervals)
        rows.append(tuple((a % 1.0 * period, b % 1.0 * period) for a, b in pulses))
    return Gait(period, relaxation.pressure_kpa, tuple(rows)), tuple(counts)


def sum_up(levels: np.ndarray) -> np.ndarray:
    """Return the on/off sequence (True: +1) whose running sum follows that of `levels`."""
    owed, on = 0.0, np.zeros(levels.size, dtype=bool)
    for k, level in enumerate(levels):
        # sum-up rounding: what is owed stays within one step, so the integral of the valve does
        owed += level
        on[k] = owed >= 0
        owed -= 1.0 if on[k] else -1.0
    return on


def intervals_of(on: np.ndarray) -> list[tuple[float, float]]:
    """Return the cyclic on-intervals as (start, end) fractions of the cycle, starts in [0, 1)."""
    # cyclic: the first place is compared with the last
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

"""Optimization on the controller's ticks: rounded gaits of several periods, then search by simulation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.continuation import orbits_of
from srs_opt.gait_opt.corrections import symmetrized
from srs_opt.gait_opt.goal import tick_counts
from srs_opt.gait_opt.score import score
from srs_opt.gait_opt.search_settings import TICK_SEARCH

_Rows = tuple[tuple[tuple[int, int], ...], ...]


@dataclass(frozen=True)
class TickGait:
    """A gait in whole ticks.

    Attributes
    ----------
    period : int
    rows : per segment, (on, length) of every on-interval
    pressure_kpa : float
    """

    period: int
    rows: _Rows
    pressure_kpa: float

    @staticmethod
    def of_gait(gait: Gait, period: int) -> TickGait:
        """Return the nearest gait of `period` ticks that begins with a switch of the first segment."""
        scale = period / gait.period_s
        first = gait.intervals[0][0][0]
        rows = tuple(
            tuple(
                (round((on - first) * scale) % period, max(round((off - on) % gait.period_s * scale), 1))
                for on, off in pairs
            )
            for pairs in gait.intervals
        )
        return TickGait(period, rows, round(gait.pressure_kpa, 3))

    def gait(self, tick_s: float) -> Gait:
        """Return it in seconds."""
        rows = tuple(
            tuple((on * tick_s, (on + length) % self.period * tick_s) for on, length in pairs)
            for pairs in self.rows
        )
        return Gait(self.period * tick_s, self.pressure_kpa, rows)

    def holds(self, dwell: int) -> bool:
        """Whether every valve stays on and off for `dwell` ticks at least."""
        for pairs in self.rows:
            ordered = sorted(pairs)
            following = (*ordered[1:], (ordered[0][0] + self.period, 0))
            for (on, length), (later, _) in zip(ordered, following):
                if length < dwell or later - on - length < dwell:
                    return False
        return True


def searched_on_ticks(problem: CycleProblem, gait: Gait, rounded: Gait) -> Gait:
    """Return the best gait on ticks near `gait`, or `rounded`, which stands on them, where none is better.

    Gaits of the nearest periods are rounded, and even ones made exactly even; from the best of them single
    switches, whole intervals, the rest of the wave and the pressure move by a tick (a step) for as long as
    the simulated score grows.
    """
    search = _Search(problem, max(math.ceil(problem.limits.min_dwell_s / problem.limits.tick_s - 1e-6), 1))
    # keyed by the score: starts of equal score are searched once
    starts = {search.value(start): start for start in _starts(problem, gait, rounded)}
    found = [
        search.improved(starts[value], value)
        for value in sorted(starts, reverse=True)[: TICK_SEARCH.searched_starts]
    ]
    value, best = max(found, key=lambda each: each[0], default=(-math.inf, None))
    if best is None or value <= score(problem, rounded, orbits_of(problem, rounded)).total:
        return rounded
    return best.gait(problem.limits.tick_s)


@dataclass(frozen=True)
class _Search:
    problem: CycleProblem
    dwell: int

    def value(self, trial: TickGait) -> float:
        """Return the simulated score, minus infinity for what the valves or the robot cannot do."""
        if not trial.holds(self.dwell):
            return -math.inf
        gait = trial.gait(self.problem.limits.tick_s)
        try:
            return score(self.problem, gait, orbits_of(self.problem, gait)).total
        except NoAnswerError:
            return -math.inf

    def improved(self, best: TickGait, value: float) -> tuple[float, TickGait]:
        """Return the score and gait from which no move gains; a move that gains is repeated."""
        pressure, trials, improved = self.problem.limits.pressure_kpa, 0, True
        tried = {best}
        while improved and trials < TICK_SEARCH.most_trials:
            improved = False
            for k in range(len(list(_moves(best, pressure)))):
                while trials < TICK_SEARCH.most_trials:
                    trial = list(_moves(best, pressure))[k]
                    if trial in tried:
                        break
                    tried.add(trial)
                    trials += 1
                    new = self.value(trial)
                    # not-a-number is no gain either
                    if not new > value + TICK_SEARCH.gain:
                        break
                    best, value, improved = trial, new, True
        return value, best


def _starts(problem: CycleProblem, gait: Gait, rounded: Gait) -> Iterator[TickGait]:
    tick_s = problem.limits.tick_s
    least, most = tick_counts(problem.limits.frequency_hz, tick_s)
    periods = sorted(range(least, most + 1), key=lambda n: abs(n * tick_s - gait.period_s))[
        : TICK_SEARCH.periods
    ]
    single = all(len(pairs) == 1 for pairs in gait.intervals)
    for period in periods:
        yield TickGait.of_gait(gait, period)
        yield TickGait.of_gait(rounded, period)
        # both halves of an even wave are whole ticks only then
        if single and period % 2 == 0 and problem.goal.turn == "straight":
            yield TickGait.of_gait(symmetrized(gait), period)


def _moves(gait: TickGait, pressure_kpa: tuple[float, float]) -> Iterator[TickGait]:
    """Yield the neighbours, always in the same order and number."""
    for step in (1, -1):
        for i in range(1, len(gait.rows)):
            yield _shifted(gait, range(i, len(gait.rows)), step)
            yield _shifted(gait, range(i, i + 1), step)
        for i, pairs in enumerate(gait.rows):
            for k, (on, length) in enumerate(pairs):
                yield _with(gait, i, k, on, length + step)
                yield _with(gait, i, k, on + step, length - step)
        for share in TICK_SEARCH.pressure_steps:
            pressure = float(np.clip(gait.pressure_kpa * (1 + step * share), *pressure_kpa))
            yield replace(gait, pressure_kpa=round(pressure, 3))


def _shifted(gait: TickGait, segments: range, step: int) -> TickGait:
    rows = tuple(
        tuple(((on + step) % gait.period, length) for on, length in pairs) if i in segments else pairs
        for i, pairs in enumerate(gait.rows)
    )
    return replace(gait, rows=rows)


def _with(gait: TickGait, segment: int, interval: int, on: int, length: int) -> TickGait:
    pairs = list(gait.rows[segment])
    pairs[interval] = (on % gait.period, length)
    return replace(gait, rows=(*gait.rows[:segment], tuple(pairs), *gait.rows[segment + 1 :]))

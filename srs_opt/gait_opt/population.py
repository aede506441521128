"""A population of simulated gaits (CMA-ES): where the landscape has many optima, gradients find the nearest.

Waves only, one on-interval per segment. Nothing is smoothed and nothing discretized: a gait's fitness is the
score of its simulated steady motion, so that what the population finds is a start from which collocation
only has to sharpen the switch times.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.guess import gait_of, switches_of
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.evolution import evolution
from srs_opt.gait_opt.score import score
from srs_opt.gait_opt.search_settings import POPULATION
from srs_opt.gait_opt.starts import starting_gaits
from srs_opt.orbit.steady import Orbit, steady_gaits
from srs_opt.parallel import executor
from srs_opt.parallel.sweep import Resume, sweep

_OTHER_SEED = 1000
_NOTHING = 1e3  # cost of a gait without a steady state


@dataclass(frozen=True)
class Coordinates:
    """Frequency and pressure over their limits, on-times after the first, lengths (held where straight)."""

    problem: CycleProblem

    @property
    def straight(self) -> bool:
        """Whether every on-interval lasts half a cycle: then robots without a side run straight."""
        return self.problem.goal.turn == "straight"

    def of(self, gait: Gait) -> np.ndarray:
        """Return the coordinates of a gait."""
        limits = self.problem.limits
        ranges = ((gait.frequency_hz, limits.frequency_hz), (gait.pressure_kpa, limits.pressure_kpa))
        head = [(value - low) / max(high - low, 1e-9) for value, (low, high) in ranges]
        on, off = switches_of(gait, gait.intervals[0][0][0]).reshape(-1, 2).T
        middles = (on + off) / 2
        return np.array([*head, *(middles[1:] - middles[0]), *([] if self.straight else off - on)])

    def gait(self, x: np.ndarray) -> Gait:
        """Return the gait at coordinates `x`, inside the limits whatever they are."""
        limits, segments = self.problem.limits, self.problem.robots[0].segments
        (f_low, f_high), (p_low, p_high) = limits.frequency_hz, limits.pressure_kpa
        frequency = f_low + float(_reflected(x[0])) * (f_high - f_low)
        middles = np.concatenate([[0.0], x[2 : 1 + segments]])
        dwell = limits.min_dwell_s * frequency
        lengths = np.full(segments, 0.5)
        if not self.straight:
            lengths = dwell + _reflected((x[1 + segments :] - dwell) / (1 - 2 * dwell)) * (1 - 2 * dwell)
        on = middles - lengths / 2
        switches = np.stack([on, on + lengths], axis=1).ravel() - on[0]
        return gait_of(switches, frequency, p_low + float(_reflected(x[1])) * (p_high - p_low), 1)


def _reflected(share: np.ndarray) -> np.ndarray:
    """Return numbers folded into [0, 1]."""
    # folded and not clipped: clipping would pile a population up at the limits
    folded: np.ndarray = 1 - np.abs(1 - np.mod(share, 2.0))
    return folded


def populations(
    problem: CycleProblem,
    most: int,
    seed: int,
    say: Callable[[str], None],
    *,
    jobs: int = 1,
    cluster: str | None = None,
    resume: Path | None = None,
) -> Iterator[Gait]:
    """Yield what populations come to, until two agree on the best or `most` are done (two at least).

    They begin at other waves than the searches with the same seed.
    """
    evaluations = POPULATION.evaluations
    kept = None if resume is None else Resume(resume, f"population of {evaluations} {problem}")
    begins = starting_gaits(problem, max(most, POPULATION.together) + 1, seed + _OTHER_SEED)[1:]
    pieces = [(seed + k, start) for k, start in enumerate(begins)]
    totals: list[float] = []
    for k in range(0, len(pieces), POPULATION.together):
        work = partial(_evolved, problem, evaluations)
        batch = pieces[k : k + POPULATION.together]
        with executor(jobs, cluster) as where:
            for record in sweep(work, batch, chunk=1, where=where, resume=kept):
                gait = Gait.of_record(record["gait"])
                totals.append(float(record["total"]))
                say(f"population {len(totals)}: score {totals[-1]:.4f}")
                yield gait
        first, second = sorted(totals, reverse=True)[:2]
        if first - second <= POPULATION.agreement * abs(first):
            return


def _evolved(
    problem: CycleProblem, evaluations: int, pieces: Sequence[tuple[int, Gait]]
) -> list[dict[str, Any]]:
    found = []
    for seed, start in pieces:
        gait, total = evolved(problem, start, seed, evaluations)
        found.append({"gait": gait.record(), "total": total})
    return found


def evolved(problem: CycleProblem, start: Gait, seed: int, evaluations: int) -> tuple[Gait, float]:
    """Return the best gait of a population that begins around `start`, and its score.

    Parameters
    ----------
    start : Gait
        With one on-interval per segment.
    evaluations : int
        Gaits to be simulated, at most; fewer where the population comes to rest.
    """
    at = Coordinates(problem)
    best, least = start, simulated_costs(problem, [start])[0]
    generations = evolution(
        lambda genes: [at.gait(x) for x in genes],
        partial(simulated_costs, problem),
        at.of(start),
        POPULATION.spread,
        seed=seed + 1,
        popsize=POPULATION.size,
        maxfevals=evaluations,
        tolfun=POPULATION.settled,
    )
    for gaits, costs in generations:
        k = int(np.argmin(costs))
        if costs[k] < least:
            best, least = gaits[k], costs[k]
    return best, -least


def simulated_costs(problem: CycleProblem, gaits: Sequence[Gait]) -> list[float]:
    """Return minus the scores of gaits, simulated (soft robots: from rest)."""
    each = [steady_gaits(robot, gaits, problem.model) for robot in problem.robots]
    costs = []
    for gait, orbits in zip(gaits, zip(*each)):
        found: tuple[Orbit, ...] = tuple(o for o in orbits if not isinstance(o, NoAnswerError))
        whole = len(found) == len(orbits)
        costs.append(-score(problem, gait, found).total if whole else _NOTHING)
    return costs

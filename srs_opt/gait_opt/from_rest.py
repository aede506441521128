"""Search about a gait by simulation from rest, for soft bodies with several orbits.

Collocation follows an orbit's derivatives wherever the orbit leads. What counts is the orbit that is reached
from rest, and where a gait moves out of its reach the merit jumps: gradients know nothing of that. CMA-ES
compares gaits simulated from rest, on the controller's ticks, since a millisecond can decide which orbit is
reached.

Source: N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from srs_opt.gait import Gait
from srs_opt.gait_opt.certificate import reached_from_rest, standing_start
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.continuation import Step, orbits_of
from srs_opt.gait_opt.corrections import on_ticks
from srs_opt.gait_opt.evolution import evolution
from srs_opt.gait_opt.population import Coordinates, simulated_costs
from srs_opt.gait_opt.search_settings import FROM_REST


@dataclass(frozen=True)
class FromRest:
    """What the search brought.

    Attributes
    ----------
    gait : Gait
    before, after : float
        Score of the gait that it began with and of `gait`.
    evaluations : int
        Gaits simulated (each on all robots).
    interrupted : bool
        Whether Ctrl-C ended the search early.
    """

    gait: Gait
    before: float
    after: float
    evaluations: int
    interrupted: bool = False

    def record(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {
            "method": "cma-es",
            "evaluations": self.evaluations,
            "merit_before": self.before,
            "merit_after": self.after,
        }


def misled(steps: Sequence[Step]) -> bool:
    """Whether some step's collocated orbit was not the one that its gait reaches from rest."""
    return any(step.astray > FROM_REST.misled for step in steps)


def search_from_rest(problem: CycleProblem, gait: Gait, seed: int = 0) -> FromRest:
    """Return the best gait that CMA-ES finds about `gait`, which has one on-interval per segment."""
    at = Coordinates(problem)
    start = at.of(gait)
    spread = np.where(np.arange(start.size) < 2, FROM_REST.spread_limits, FROM_REST.spread_cycles)
    before = -simulated_costs(problem, [gait])[0]
    best, after, count = gait, before, 1
    limits = problem.limits
    generations = evolution(
        lambda genes: [on_ticks(at.gait(x), limits.tick_s, limits.frequency_hz) for x in genes],
        partial(simulated_costs, problem),
        start,
        spread,
        seed=np.random.default_rng(seed),
        popsize=FROM_REST.members,
        maxiter=FROM_REST.generations,
        tolfun=FROM_REST.settled,
    )
    try:
        for gaits, costs in generations:
            count += len(gaits)
            for k in np.argsort(costs):
                if -costs[k] <= after:
                    break
                if _stands(problem, gaits[k]):
                    best, after = gaits[k], -costs[k]
                    break
    except KeyboardInterrupt:
        return FromRest(best, before, after, count, interrupted=True)
    return FromRest(best, before, after, count)


def _stands(problem: CycleProblem, gait: Gait) -> bool:
    """Whether a standing start comes to the steady motion on every robot, as the certificate will ask."""
    return all(
        reached_from_rest(robot, orbit.speed_m_s, standing_start(robot, gait, problem.model))
        for robot, orbit in zip(problem.robots, orbits_of(problem, gait))
    )

"""From the optimum to what a controller plays: whole ticks, the turn put right, checked against its score."""

from __future__ import annotations

from srs_opt.gait import Gait
from srs_opt.gait_opt.aim import aimed, evened, on_ticks
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.ladder import orbits_of
from srs_opt.gait_opt.score import Score, score
from srs_opt.gait_opt.starts import turn_miss

_TURN_RAD_S = 5e-3
_LOST = 1e-3  # merit that an exactly straight gait may cost


def finished(problem: CycleProblem, gait: Gait) -> Gait:
    """Return the gait on ticks, with the turn that rounding and discretization moved put right."""
    goal, limits = problem.goal, problem.limits
    gait = on_ticks(gait, limits.tick_s, limits.frequency_hz)
    straight = goal.radius_m is None and not goal.turn_rate_rad_s and not goal.tightest
    if straight and all(len(pairs) == 1 for pairs in gait.intervals):
        even = on_ticks(evened(gait), limits.tick_s, limits.frequency_hz)
        as_found = _score(problem, gait)
        if _score(problem, even).total > as_found.total - _LOST * as_found.scale:
            return even
    if goal.tightest:
        return gait
    return on_ticks(aimed(gait, turn_miss(problem), _TURN_RAD_S, 0.1), limits.tick_s, limits.frequency_hz)


def _score(problem: CycleProblem, gait: Gait) -> Score:
    return score(problem, gait, orbits_of(problem, gait))

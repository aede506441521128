"""From the optimum to what a controller plays: whole ticks, the turn put right, checked against its score."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.gait_opt.certificate import Certificate, certify
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.continuation import Report, orbits_of
from srs_opt.gait_opt.corrections import on_ticks, steered, symmetrized
from srs_opt.gait_opt.prices import of_ticks
from srs_opt.gait_opt.score import Score, score
from srs_opt.gait_opt.search_settings import ROUNDING
from srs_opt.gait_opt.settings import CERTIFICATE
from srs_opt.gait_opt.starts import turn_miss
from srs_opt.gait_opt.switch_times import ExactSwitchTimes, collocated_speeds, optimize_switch_times
from srs_opt.gait_opt.tick_search import searched_on_ticks
from srs_opt.orbit.steady import Orbit


def finished(
    problem: CycleProblem, gait: Gait, reach: float, report: Report | None = None
) -> tuple[ExactSwitchTimes, Certificate, tuple[Orbit, ...]]:
    """Return what the switch times' optimization made of `gait`, and the finished gait's certificate, orbits.

    The mesh sees band and curvature at some instants only: where the finished gait exceeds a limit, less is
    asked for by as much. Where the optimum is worth less on ticks than the given gait, or only that gets a
    certificate, the given one is kept; so it is where a soft body has no steady motion with what was found.
    """
    try:
        return _finished(problem, gait, reach, report)
    except NoAnswerError:
        plain = rounded(problem, gait)
        speeds = tuple(orbit.speed_m_s for orbit in orbits_of(problem, plain))
        certificate, orbits = certify(problem, plain, speeds)
        return (
            ExactSwitchTimes(plain, orbits, score(problem, plain, orbits), speeds, ()),
            certificate,
            orbits,
        )


def _finished(
    problem: CycleProblem, gait: Gait, reach: float, report: Report | None
) -> tuple[ExactSwitchTimes, Certificate, tuple[Orbit, ...]]:
    asked, given = problem, gait
    for _ in range(ROUNDING.rounds):
        exact = optimize_switch_times(asked, gait, reach, report)
        played = quantized(problem, exact.gait)
        certificate, orbits = certify(problem, played, _claimed(problem, exact, played))
        less = _less_asked(problem, asked, orbits)
        if less is None:
            break
        asked, gait = less, exact.gait
    plain = rounded(problem, given)
    before = _score(problem, plain)
    worse = score(problem, orbits[0].gait, orbits).total < before.total - ROUNDING.loss * before.scale
    if worse or (not certificate.passed and orbits[0].gait != plain):
        # a millisecond further a soft body may settle in another orbit: then what was given is kept
        known = orbits_of(problem, plain)
        speeds = tuple(o.speed_m_s for o in known)
        kept, known = certify(problem, plain, speeds)
        if worse or kept.passed:
            return ExactSwitchTimes(plain, known, before, speeds, exact.steps), kept, known
    lost = exact.score.total - score(problem, orbits[0].gait, orbits).total
    if lost > ROUNDING.loss * exact.score.scale:
        exact = replace(exact, prices=(of_ticks(problem, lost), *exact.prices))
    return exact, certificate, orbits


def _claimed(problem: CycleProblem, exact: ExactSwitchTimes, played: Gait) -> tuple[float, ...]:
    """Return the speeds by collocation that the certificate compares with simulation.

    Those of the last solve, unless the gait that is played differs so much from it, by ticks or because no
    solve improved on the gait that it began with, that collocation has to be asked about this one.
    """
    simulated = [o.speed_m_s for o in orbits_of(problem, played)]
    allowed = CERTIFICATE.speed_error
    near = (abs(c - s) <= allowed * abs(s) for c, s in zip(exact.claimed_m_s, simulated))
    return exact.claimed_m_s if all(near) else collocated_speeds(problem, played) or exact.claimed_m_s


def _less_asked(problem: CycleProblem, asked: CycleProblem, orbits: tuple[Orbit, ...]) -> CycleProblem | None:
    """Return the problem with tighter limits than `asked`, None where the orbits keep those of `problem`."""
    band, most = problem.goal.envelope_m, problem.limits.max_curvature_1_m
    goal, limits = asked.goal, asked.limits
    if band is not None and goal.envelope_m is not None:
        excess = max(sum(o.envelope_m) for o in orbits) - band
        if excess > CERTIFICATE.limit_excess * band:
            goal = replace(goal, envelope_m=goal.envelope_m - excess)
    if most is not None and limits.max_curvature_1_m is not None:
        excess = max(float(np.abs(o.kappa).max()) for o in orbits) - most
        if excess > CERTIFICATE.limit_excess * most:
            limits = replace(limits, max_curvature_1_m=limits.max_curvature_1_m - excess)
    return None if (goal, limits) == (asked.goal, asked.limits) else replace(asked, goal=goal, limits=limits)


def quantized(problem: CycleProblem, gait: Gait) -> Gait:
    """Return the gait on ticks; where rounding costs something, the best one that a search on ticks finds."""
    near = rounded(problem, gait)
    exact = _score(problem, gait)
    if _score(problem, near).total > exact.total - ROUNDING.loss * exact.scale:
        return near
    return searched_on_ticks(problem, gait, near)


def rounded(problem: CycleProblem, gait: Gait) -> Gait:
    """Return the gait on ticks, with the turn that rounding and discretization moved put right."""
    goal, limits = problem.goal, problem.limits
    exact = gait
    gait = on_ticks(exact, limits.tick_s, limits.frequency_hz)
    straight = goal.turn == "straight" or goal.turn_rate_rad_s == 0
    if straight and all(len(pairs) == 1 for pairs in gait.intervals):
        even = on_ticks(symmetrized(exact), limits.tick_s, limits.frequency_hz)
        as_found = _score(problem, gait)
        if _score(problem, even).total > as_found.total - ROUNDING.loss * as_found.scale:
            return even
    if goal.turn in ("side", "any"):
        return gait
    return on_ticks(
        steered(gait, turn_miss(problem), ROUNDING.turn_tolerance_rad_s, ROUNDING.largest_bias),
        limits.tick_s,
        limits.frequency_hz,
    )


def _score(problem: CycleProblem, gait: Gait) -> Score:
    return score(problem, gait, orbits_of(problem, gait))

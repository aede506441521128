"""The whole search: several starts up the ladder, the best ones to the top, then the finished gait."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.gait_opt.aim import within
from srs_opt.gait_opt.certificate import Certificate, certify
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.finish import finished
from srs_opt.gait_opt.ladder import Climb, Rung, Step, climb, ladder
from srs_opt.gait_opt.score import Score
from srs_opt.gait_opt.starts import starting_gaits, steered
from srs_opt.gait_opt.switch_times import optimize_switch_times
from srs_opt.orbit.steady import Orbit

Say = Callable[[str], None]
_CARRIED = 2  # starts that are carried to the robot's own friction
_ALIKE = 1e-3  # merits closer than this are one optimum
_WARM_REACH = 0.05
_EXACT_REACH = 0.01


@dataclass(frozen=True)
class Found:
    """The result of a search.

    Attributes
    ----------
    gait : Gait
        On the controller's ticks.
    orbits : tuple of Orbit, one per robot
    certificate : Certificate
    merits : tuple of float
        Best merit of every start, in the order of the starts (at the rung to which it was carried).
    steps : tuple of Step
        Of the winning start.
    iterations, seconds
        Over all starts; the time includes compiling.
    interrupted : bool
        Whether Ctrl-C ended the search early.
    """

    gait: Gait
    orbits: tuple[Orbit, ...]
    certificate: Certificate
    merits: tuple[float, ...]
    steps: tuple[Step, ...]
    iterations: int
    seconds: float
    interrupted: bool


def search(
    problem: CycleProblem,
    starts: int = 4,
    seed: int = 0,
    say: Say = lambda text: None,
    warm: Gait | None = None,
) -> Found:
    """Return the best gait found for `problem`.

    Parameters
    ----------
    starts : int
        The published gait, then quasi-random waves.
    warm : Gait, optional
        The result of an earlier search: start from it alone, near the top of the ladder.

    Raises
    ------
    NoAnswerError
        If no start leads anywhere.
    """
    begun = time.perf_counter()
    own = max(r.friction_speed_m_s for r in problem.robots)
    if warm is None:
        candidates = starting_gaits(problem, starts, seed)
        rungs = ladder(own)
        cut = max(len([r for r in rungs if r.friction_speed_m_s >= 0.01]), len(rungs) - 2)
        lower, upper = rungs[:cut], rungs[cut:]
    else:
        candidates, lower = [steered(problem, within(problem.limits, warm))], ()
        upper = (Rung(max(own, 0.004), 64, _WARM_REACH, 2), Rung(own, 80, _WARM_REACH / 2, 2))
    climbs, interrupted = _explore(problem, candidates, lower, say)
    order = sorted(range(len(climbs)), key=lambda k: -climbs[k].score.total)
    carried: list[Climb] = []
    for k in _distinct(order, climbs)[:_CARRIED]:
        if interrupted:
            break
        try:
            top = climb(problem, climbs[k].gait, upper, _reporter(say, k, len(climbs)))
        except KeyboardInterrupt:
            interrupted = True
            break
        except NoAnswerError:
            continue
        top = Climb(top.gait, top.orbits, top.score, (*climbs[k].steps, *top.steps))
        climbs[k] = top
        carried.append(top)
    best = max(carried or climbs, key=lambda c: c.score.total)
    top_start = next(k for k, c in enumerate(climbs) if c is best)
    exact = optimize_switch_times(problem, best.gait, _EXACT_REACH, _reporter(say, top_start, len(climbs)))
    certificate, orbits = certify(problem, finished(problem, exact.gait), exact.claimed_m_s)
    return Found(
        orbits[0].gait,
        orbits,
        certificate,
        tuple(c.score.merit for c in climbs),
        (*best.steps, *exact.steps),
        sum(c.iterations for c in climbs) + sum(s.iterations for s in exact.steps),
        time.perf_counter() - begun,
        interrupted,
    )


def _explore(
    problem: CycleProblem, candidates: list[Gait], rungs: tuple[Rung, ...], say: Say
) -> tuple[list[Climb], bool]:
    climbs: list[Climb] = []
    reasons = []
    for k, start in enumerate(candidates):
        try:
            climbs.append(climb(problem, start, rungs, _reporter(say, k, len(candidates))))
        except NoAnswerError as error:
            reasons.append(str(error))
            say(f"start {k + 1} of {len(candidates)}: {error}")
        except KeyboardInterrupt:
            if not climbs:
                raise
            return climbs, True
    if not climbs:
        raise NoAnswerError(f"no start leads to a steady gait inside the limits: {reasons[-1]}")
    return climbs, False


def _distinct(order: list[int], climbs: list[Climb]) -> list[int]:
    kept: list[int] = []
    for k in order:
        if all(abs(climbs[k].score.total - climbs[j].score.total) > _ALIKE for j in kept):
            kept.append(k)
    return kept


def _reporter(say: Say, start: int, starts: int) -> Callable[[Step, Score], None]:
    def report(step: Step, best: Score) -> None:
        rung = step.rung
        say(
            f"start {start + 1} of {starts}: friction smoothed at {rung.friction_speed_m_s:g} m/s, "
            f"{step.elements} elements, {step.iterations} iterations: "
            f"{step.speed_m_s:.4f} m/s by collocation, "
            f"{step.simulated_m_s:.4f} simulated; best {best.total:.4f}{step.trouble}"
        )

    return report

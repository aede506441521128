"""The whole search: continuation from several starts, the best ones to the end, then the gait on ticks."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.gait_opt.certificate import Certificate
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.continuation import (
    Continuation,
    Stage,
    Step,
    continuation_stages,
    orbits_of,
    run_stages,
)
from srs_opt.gait_opt.corrections import within
from srs_opt.gait_opt.finish import finished
from srs_opt.gait_opt.from_rest import FromRest, misled, search_from_rest
from srs_opt.gait_opt.goal import Goal
from srs_opt.gait_opt.population import populations
from srs_opt.gait_opt.prices import Price
from srs_opt.gait_opt.reach import refuse_contradictions
from srs_opt.gait_opt.score import Score, score
from srs_opt.gait_opt.search_settings import GAIT_SEARCH
from srs_opt.gait_opt.starts import starting_gaits, turned
from srs_opt.orbit.steady import Orbit
from srs_opt.parallel import executor
from srs_opt.parallel.sweep import Resume, sweep
from srs_opt.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Say = Callable[[str], None]


@dataclass(frozen=True)
class Where:
    """What runs the starts' continuations: processes here or a cluster; and where finished ones are kept."""

    jobs: int = 1
    cluster: str | None = None
    resume: Path | None = None


HERE = Where()


@dataclass(frozen=True, repr=False)
class Found(Result):
    """The result of a search.

    Attributes
    ----------
    gait : Gait
        On the controller's ticks.
    orbits : tuple of Orbit, one per robot
    certificate : Certificate
    merits : tuple of float
        Best merit of every start that led somewhere, in their order (at the stage to which it was carried).
    populations : int
        How many of these, the last ones, are of populations of simulated gaits.
    steps : tuple of Step
        Of the winning start.
    iterations, seconds
        Over all starts; the time includes compiling.
    interrupted : bool
        Whether Ctrl-C ended the search early.
    prices : tuple of Price
        What the limits that are active at the optimum cost.
    from_rest : FromRest, optional
        The search by simulation from rest that followed the continuations, where collocation was misled.
    """

    gait: Gait
    orbits: tuple[Orbit, ...]
    certificate: Certificate
    merits: tuple[float, ...]
    populations: int
    steps: tuple[Step, ...]
    iterations: int
    seconds: float
    interrupted: bool
    prices: tuple[Price, ...] = ()
    from_rest: FromRest | None = None

    @property
    def speed_m_s(self) -> float:
        """Speed of the gait on the first robot."""
        return self.orbits[0].speed_m_s

    def to_dict(self) -> dict[str, Any]:
        """Return the gait, its motion on every robot, and whether the certificate passed."""
        return {
            "gait": self.gait.record(),
            "robots": [orbit.to_dict() for orbit in self.orbits],
            "certified": self.certificate.passed,
            "starts": list(self.merits),
            "seconds": self.seconds,
        }

    def in_words(self) -> str:
        """Return what the gait does on the first robot, and what the certificate says."""
        return f"{self.orbits[0].in_words()}; certificate {'passed' if self.certificate.passed else 'FAILED'}"

    def figure(self) -> Figure:
        """Return the gait sheet on the first robot."""
        return self.orbits[0].figure()


def search(
    problem: CycleProblem,
    starts: int = 4,
    seed: int = 0,
    say: Say = lambda text: None,
    warm: Gait | None = None,
    *,
    where: Where = HERE,
) -> Found:
    """Return the best gait found for `problem`.

    Parameters
    ----------
    starts : int
        The published gait, then quasi-random waves.
    warm : Gait, optional
        The result of an earlier search: start from it alone, at the last stages. Only where that
        leads to no certified gait, the whole search follows.
    where : Where
        What runs the continuations; the result is the same.

    Raises
    ------
    NoAnswerError
        If limits contradict each other, no start leads anywhere, or the wanted speed lies beyond that of the
        fastest gait.
    """
    begun = time.perf_counter()
    refuse_contradictions(problem)
    if warm is None and problem.goal.speed_m_s:
        say("optimizing the fastest straight gait first: is the wanted speed feasible?")
        _refuse_out_of_reach(problem, problem.goal.speed_m_s, starts, seed, say, where)
    own = max(r.friction_speed_m_s for r in problem.robots)
    if warm is None:
        candidates = starting_gaits(problem, starts, seed)
        # tight turns and pivots have more optima than starts: a population alone does better, and sooner
        stages = () if _rugged(problem) else continuation_stages(own, quick=problem.goal.only_fast)
        # below 0.01 m/s stages are costly: only the best starts are carried on to them
        cut = max(len([r for r in stages if r.friction_speed_m_s >= 0.01]), len(stages) - 2)
        lower, upper = stages[:cut], stages[cut:]
        reach = GAIT_SEARCH.exact_reach
    else:
        start, near = _warmed(problem, warm, say)
        candidates, lower = [start], ()
        upper = () if near else (_moved_stage(own),)
        reach = GAIT_SEARCH.near_reach if near else GAIT_SEARCH.moved_reach
    continuing = _Continuing(problem, len(candidates), say)
    continued, interrupted = _all(continuing, list(enumerate(candidates)), lower, where)
    if not continued:
        if interrupted:
            raise KeyboardInterrupt
        raise NoAnswerError("no start converged to a steady gait within the limits")
    if not interrupted:
        chosen = _distinct(continued)[: GAIT_SEARCH.carried_starts]
        carried, interrupted = _all(continuing, [(k, continued[k].gait) for k in chosen], upper, where)
        for k, top in carried.items():
            continued[k] = replace(top, steps=(*continued[k].steps, *top.steps))
    evolved: list[Continuation] = []
    whole = warm is None and problem.intervals == 1
    astray = whole and misled([step for c in continued.values() for step in c.steps])
    if not interrupted and whole and (_rugged(problem) or (_scatter(continued) and not astray)):
        evolved, interrupted = _evolved(problem, continued, starts, seed, say, where)
    if evolved and _rugged(problem):  # the starts were not searched
        continued = {}
    continued |= {len(candidates) + k: found for k, found in enumerate(evolved)}
    # simulated scores, so that starts, populations and stages compare
    best = max(continued, key=lambda k: continued[k].score.total)
    reached = continued[best].gait
    settled: FromRest | None = None
    if astray and not interrupted:
        say("collocation found orbits that are not reached from rest: searching by simulation from rest")
        settled = search_from_rest(problem, reached, seed)
        reached, interrupted = settled.gait, settled.interrupted
    exact, certificate, orbits = finished(problem, reached, reach, _reporter(say, best, len(candidates)))
    if warm is not None and not certificate.passed and not interrupted:
        say(f"no valid gait near the earlier one ({certificate.failures[0]}): running the whole search")
        return search(problem, starts, seed, say, where=where)
    return Found(
        orbits[0].gait,
        orbits,
        certificate,
        tuple(c.score.merit for c in continued.values()),
        len(evolved),
        (*continued[best].steps, *exact.steps),
        sum(c.iterations for c in continued.values()) + sum(s.iterations for s in exact.steps),
        time.perf_counter() - begun,
        interrupted,
        exact.prices,
        settled,
    )


def _moved_stage(own_m_s: float) -> Stage:
    """Return the stage for an earlier result that had to move."""
    s = GAIT_SEARCH
    friction_m_s = max(own_m_s, s.moved_friction_m_s)
    return Stage(friction_m_s, s.moved_elements, s.moved_stage_reach, s.moved_repeats, quick=True)


def _rugged(problem: CycleProblem) -> bool:
    """Whether the goal is known to have more optima than starts would find."""
    return problem.goal.turn == "side" and problem.intervals == 1


def _scatter(continued: dict[int, Continuation]) -> bool:
    """Whether several starts led somewhere and no second one confirms the best."""
    totals = sorted((c.score.total for c in continued.values()), reverse=True)
    return len(totals) > 1 and totals[0] - totals[1] > GAIT_SEARCH.scatter * abs(totals[0])


def _evolved(
    problem: CycleProblem, continued: dict[int, Continuation], starts: int, seed: int, say: Say, where: Where
) -> tuple[list[Continuation], bool]:
    """Return what populations of simulated gaits come to, and whether Ctrl-C ended them early."""
    totals = [c.score.total for c in continued.values()]
    if _rugged(problem):
        say("this objective has many local optima: searching with populations of simulated gaits")
    else:
        scatter = f"the starts scatter from {min(totals):.4f} to {max(totals):.4f}"
        say(f"{scatter}: continuing with populations of simulated gaits")
    found: list[Continuation] = []
    many = populations(
        problem, 2 * starts, seed, say, jobs=where.jobs, cluster=where.cluster, resume=where.resume
    )
    try:
        for gait in many:
            orbits = orbits_of(problem, gait)
            found.append(Continuation(gait, orbits, score(problem, gait, orbits)))
    except KeyboardInterrupt:
        return found, True
    return found, False


def _warmed(problem: CycleProblem, warm: Gait, say: Say) -> tuple[Gait, bool]:
    """Return an earlier result inside the limits, and whether it does what is wanted as it is."""
    goal = problem.goal
    if goal.turn == "side" and goal.sense * orbits_of(problem, warm)[0].turn_rate_rad_s < 0:
        say(f"the earlier gait turns away from the {goal.side}: using its mirror image")
        warm = warm.mirrored()
    start = within(problem.limits, warm)
    if start == warm and score(problem, warm, orbits_of(problem, warm)).miss < GAIT_SEARCH.kept_miss:
        return warm, True
    return turned(problem, start), False


def _refuse_out_of_reach(
    problem: CycleProblem, speed_m_s: float, starts: int, seed: int, say: Say, where: Where
) -> None:
    """Refuse a speed that even the fastest straight gait does not make, before the long search for it."""
    only_fast = replace(problem, goal=Goal("speed"))
    fastest = search(only_fast, starts, seed, say, where=where)
    if fastest.interrupted:
        raise KeyboardInterrupt
    slowest = min(fastest.certificate.robots, key=lambda r: r.speed_m_s)
    if speed_m_s > (1 + GAIT_SEARCH.beyond_fastest) * slowest.speed_m_s:
        who = f" with robot '{slowest.name}'" if len(problem.robots) > 1 else ""
        raise NoAnswerError(
            f"no gait makes {speed_m_s:g} m/s{who}: the fastest that was found within these limits runs at "
            f"{slowest.speed_m_s:.3f} m/s; ask for less, or widen --pressure or --frequency"
        )


@dataclass(frozen=True)
class _Continuing:
    """What all starts have in common."""

    problem: CycleProblem
    starts: int
    say: Say

    def __call__(self, stages: tuple[Stage, ...], pieces: Sequence[tuple[int, Gait]]) -> list[dict[str, Any]]:
        """Take each gait up the stages; return records of where it came and by which steps."""
        return [self._one(stages, k, gait) for k, gait in pieces]

    def _one(self, stages: tuple[Stage, ...], start: int, gait: Gait) -> dict[str, Any]:
        try:
            found = run_stages(self.problem, gait, stages, _reporter(self.say, start, self.starts))
        except NoAnswerError as error:
            self.say(f"start {start + 1} of {self.starts}: {error}")
            return {"gait": None, "steps": []}
        return {"gait": found.gait.record(), "steps": [asdict(step) for step in found.steps]}


def _all(
    continuing: _Continuing, gaits: list[tuple[int, Gait]], stages: tuple[Stage, ...], where: Where
) -> tuple[dict[int, Continuation], bool]:
    """Return the continuations of all starts that lead somewhere, and whether Ctrl-C ended them early."""
    problem = continuing.problem
    # the stages are part of the key: a start carried further is other work
    kept = None if where.resume is None else Resume(where.resume, f"gait_opt {problem} {stages}")
    work = partial(continuing, stages)
    continued: dict[int, Continuation] = {}
    try:
        with executor(where.jobs, where.cluster) as several:
            for (k, _), record in zip(gaits, sweep(work, gaits, chunk=1, where=several, resume=kept)):
                if record["gait"] is not None:
                    gait = Gait.of_record(record["gait"])
                    orbits = orbits_of(problem, gait)
                    steps = tuple(Step.of_record(step) for step in record["steps"])
                    continued[k] = Continuation(gait, orbits, score(problem, gait, orbits), steps)
    except KeyboardInterrupt:
        return continued, True
    return continued, False


def _distinct(continued: dict[int, Continuation]) -> list[int]:
    """Return the starts, best first, without those that came to the same optimum as a better one."""
    kept: list[int] = []
    for k in sorted(continued, key=lambda k: -continued[k].score.total):
        mine = continued[k].score
        if all(
            abs(mine.total - continued[j].score.total) > GAIT_SEARCH.same_optimum * mine.scale for j in kept
        ):
            kept.append(k)
    return kept


def _reporter(say: Say, start: int, starts: int) -> Callable[[Step, Score], None]:
    who = f"start {start + 1} of {starts}" if start < starts else f"population {start - starts + 1}"

    def report(step: Step, best: Score) -> None:
        stage = step.stage
        say(
            f"{who}: friction smoothed at {stage.friction_speed_m_s:g} m/s, "
            f"{step.elements} elements, {step.iterations} iterations: "
            f"{step.speed_m_s:.4f} m/s by collocation, "
            f"{step.simulated_m_s:.4f} simulated; best {best.total:.4f}{step.trouble}"
        )

    return report

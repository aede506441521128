"""The whole workflow: split, calibrate, detect, locate, screen, refit, select, check, design, seal."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from srs_opt.calibrate.coordinates import Candidate, all_candidates, base_coordinates
from srs_opt.calibrate.crew import helped
from srs_opt.calibrate.fit import Experiment, start_point
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.noise import noise_sd_m
from srs_opt.discrepancy.design import NextExperiment, next_experiment, rivals_of
from srs_opt.discrepancy.hypothesis import Hypothesis
from srs_opt.discrepancy.locate import Place, locate, odd_trials
from srs_opt.discrepancy.screen import Score
from srs_opt.discrepancy.seal import Gap, open_seal
from srs_opt.discrepancy.search import Examined, Search
from srs_opt.discrepancy.select import Selection, select
from srs_opt.discrepancy.split import LEAST_OPEN, Split, split_trials
from srs_opt.discrepancy.verdict import DETECTED, NO_GAP, NOT_TESTABLE, ONE_OF, UNKNOWN, Verdict, judge
from srs_opt.measurement.records import DataSet

NULL_ITERATIONS = 10


@dataclass(frozen=True)
class Discrepancy:
    """Everything that was found.

    Attributes
    ----------
    dataset : DataSet
    verdict : Verdict
    split : Split
    null, best : Examined or None
        Calibration alone; the best set of effects.
    selection : Selection or None
    located : tuple of Place
    scores : tuple of Score
        The screen about calibration alone.
    gap : Gap or None
    next_experiment : NextExperiment or None
    sd_m : float
        Noise as estimated from the tracks.
    seconds : float
    """

    dataset: DataSet
    verdict: Verdict
    split: Split
    null: Examined | None
    best: Examined | None
    selection: Selection | None
    located: tuple[Place, ...]
    scores: tuple[Score, ...]
    gap: Gap | None
    next_experiment: NextExperiment | None
    sd_m: float
    seconds: float
    experiment: Experiment | None = None
    fitted: tuple[Hypothesis, ...] = ()
    tried: frozenset[str] = frozenset()


def find_discrepancy(
    dataset: DataSet,
    effects: Sequence[str] | None = None,
    *,
    model: str = "complex",
    seed: int = 0,
    jobs: int = 1,
    cluster: str | None = None,
    report: Callable[[str], None] | None = None,
) -> Discrepancy:
    """Find what the model lacks.

    Parameters
    ----------
    dataset : DataSet
    effects : sequence of str, optional
        Names to consider; default all that are known.
    model : {"complex", "simplified"}
    seed : int
    jobs : int
        Processes; the answer does not depend on it.
    cluster : str, optional
        Address of a Dask scheduler that gets the work instead, ``host:port``.
    report : callable, optional
        Told what is being done.
    """
    started = time.perf_counter()
    tell = report or (lambda message: None)
    split = split_trials(dataset.trials, seed)
    sd = noise_sd_m(dataset)
    if not split.enough:
        return _not_testable(dataset, split, sd, started)
    experiment = Experiment(Model(dataset.robot, model), (*split.open, *split.sealed), sd, dataset.bench)
    with helped(experiment, jobs, cluster):
        return _examine(dataset, experiment, split, _candidates(dataset, effects), seed, tell, started)


def _examine(
    dataset: DataSet,
    experiment: Experiment,
    split: Split,
    candidates: tuple[Candidate, ...],
    seed: int,
    tell: Callable[[str], None],
    started: float,
) -> Discrepancy:
    base = base_coordinates(dataset.robot)
    search = Search(experiment, base, candidates, split.open, seed, tell)
    tell(f"calibrating on {len(split.open)} trials")
    first = search.fit((), start_point(base), NULL_ITERATIONS)
    if first is None:
        why = "the robot as documented cannot be simulated under these trials' conditions"
        return _not_testable(dataset, split, experiment.sd_m, started, why)
    tell(f"screening {len(candidates)} candidates")
    null = search.examine(first)
    at_odds = contradicting(search, null) if null.detection.p_value < DETECTED else ()
    searched = null.detection.p_value < DETECTED and not at_odds
    best, fitted = search.run(null) if searched else (null, [first])
    selection = select(best.hypothesis, fitted, split)
    tell("opening the sealed trials")
    gap = open_seal(experiment, first.fit, best.hypothesis.fit, split.sealed, seed)
    verdict = judge(null, best, selection, gap, at_odds)
    following = None
    if verdict.word in (ONE_OF, UNKNOWN) and not at_odds:
        following = next_experiment(experiment, rivals_of(selection, fitted), split.open)
    return Discrepancy(
        dataset,
        verdict,
        split,
        null,
        best,
        selection,
        locate(null),
        null.scores,
        gap,
        following,
        experiment.sd_m,
        time.perf_counter() - started,
        experiment,
        tuple(fitted),
        frozenset(search.tried),
    )


def contradicting(search: Search, null: Examined) -> tuple[str, ...]:
    """Return the few trials, if any, without which calibration alone explains all the others."""
    odd = odd_trials(null)
    for count in range(1, len(odd) + 1):
        rest = [t for t in search.trials if t.name not in odd[:count]]
        if len(rest) < LEAST_OPEN:
            break
        without = Search(search.experiment, search.base, search.candidates, rest, search.seed)
        found = without.fit((), null.hypothesis.fit.point, NULL_ITERATIONS)
        if found is not None and without.examine(found).detection.p_value >= DETECTED:
            return odd[:count]
    return ()


def _candidates(dataset: DataSet, effects: Sequence[str] | None) -> tuple[Candidate, ...]:
    found = all_candidates(dataset.robot.links, effects)
    present = {str(e["name"]) for e in dataset.robot.effects}
    return tuple(c for c in found if c.effect not in present)


def _not_testable(
    dataset: DataSet, split: Split, sd: float, started: float, why: str | None = None
) -> Discrepancy:
    if why is None and not dataset.trials:
        why = "the set holds no tracks; maps alone do not show where model and robot part"
    if why is None:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in split.left_out[:3])
        why = (
            f"{len(split.open) + len(split.sealed)} usable trials, and at least 4 are needed "
            f"(3 to fit, 1 to keep sealed){'; ' + reasons if reasons else ''}"
        )
    seconds = time.perf_counter() - started
    verdict = Verdict(NOT_TESTABLE, why)
    return Discrepancy(dataset, verdict, split, None, None, None, (), (), None, None, sd, seconds)


__all__ = ["NO_GAP", "Discrepancy", "find_discrepancy"]

"""The whole workflow: split, calibrate, detect, locate, screen, refit, select, check, design, seal."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from srs_opt.calibrate.candidates import Candidate, all_candidates, fitted_coordinates
from srs_opt.calibrate.clean import cleaned
from srs_opt.calibrate.experiment import Experiment
from srs_opt.calibrate.fit import Fit
from srs_opt.calibrate.forms import form_of_entry
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.noise import Noise, noise_of, track_of
from srs_opt.calibrate.outlying_trials import outlying_trials
from srs_opt.discrepancy.alike import Pair, alike_pairs
from srs_opt.discrepancy.describe import Description, confirmation, describe_gap
from srs_opt.discrepancy.design import NextExperiment, next_experiment, repeat_of, rivals_of
from srs_opt.discrepancy.diagnostics import Diagnostics
from srs_opt.discrepancy.first import first_experiment
from srs_opt.discrepancy.hypothesis import Hypothesis
from srs_opt.discrepancy.locate import Place, locate, misfit_by_trial
from srs_opt.discrepancy.screen import Score
from srs_opt.discrepancy.seal import Gap, odd_sealed, open_seal
from srs_opt.discrepancy.search import Search
from srs_opt.discrepancy.select import Selection, best_rival, select
from srs_opt.discrepancy.settings import ADEQUACY, AdequacySettings
from srs_opt.discrepancy.split import Split, few_and_brief, split_trials
from srs_opt.discrepancy.verdict import BELIEVED, DESCRIBED, NO_GAP, NOT_TESTABLE, UNKNOWN, Verdict, judge
from srs_opt.discrepancy.visible import Visible, visible
from srs_opt.effects.generic import TERMS
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import DataSet
from srs_opt.parallel import HERE, Executor
from srs_opt.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Discrepancy(Result):
    """Everything that was found.

    Attributes
    ----------
    dataset : DataSet
    verdict : Verdict
    split : Split
    null, best : Diagnostics or None
        Calibration alone; the best set of effects.
    selection : Selection or None
    located : tuple of Place
    scores : tuple of Score
        The screen about calibration alone.
    gap : Gap or None
    next_experiment : NextExperiment or None
    description : Description or None
        What the grammar's terms say of a gap that no listed effect explains, believed or not.
    sd_m : float
        Noise as estimated from the tracks.
    seconds : float
    odd : tuple of (str, str)
        Trials set aside because they contradict the others, and what speaks against them.
    would_have_seen : Visible or None
        The smallest missing effect that the data would have shown; where they show none.
    outlier_share : float or None
        Share of positions that were left out; None where none were looked for.
    """

    dataset: DataSet
    verdict: Verdict
    split: Split
    null: Diagnostics | None
    best: Diagnostics | None
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
    alike: tuple[Pair, ...] = ()
    description: Description | None = None
    odd: tuple[tuple[str, str], ...] = ()
    would_have_seen: Visible | None = None
    outlier_share: float | None = None

    @property
    def noise(self) -> Noise:
        """What of the data is neither the model nor the trials' scatter."""
        return Noise(self.sd_m) if self.experiment is None else self.experiment.noise

    @property
    def believed(self) -> bool:
        """Whether the best set of effects is taken for what is missing, or for a part of it."""
        return self.verdict.word in BELIEVED

    @property
    def shown_in(self) -> Experiment | None:
        """In which the best can be simulated: a described gap's knows the term, not the listed effects."""
        term = self.description.experiment if self.verdict.word == DESCRIBED and self.description else None
        return term or self.experiment

    @property
    def answer(self) -> Hypothesis | None:
        """The best set of effects, or the term that describes the gap."""
        return self.selection.best if self.selection else None

    def to_dict(self) -> dict[str, Any]:
        """Return the content of discrepancy.json."""
        from srs_opt.discrepancy.answer import answer

        return answer(self, None)

    def in_words(self) -> str:
        """Return the verdict and its reason."""
        return f"{self.verdict.word}: {self.verdict.why}"

    def figure(self) -> Figure:
        """Return the picture of the gap that closes on a sealed trial.

        Raises
        ------
        NoAnswerError
            If no effect closes a gap.
        """
        from srs_opt.discrepancy.pictures import gap_figure

        drawn = gap_figure(self)
        if drawn is None:
            raise NoAnswerError(f"no gap to draw: {self.verdict.why}")
        return drawn

    @property
    def set_aside(self) -> tuple[tuple[str, str], ...]:
        """Trials that no figure rests on, and why."""
        return (*self.split.left_out, *self.odd)


def diagnose(
    dataset: DataSet,
    effects: Sequence[str] | None = None,
    *,
    model: str | None = None,
    seed: int = 0,
    where: Executor = HERE,
    report: Callable[[str], None] | None = None,
) -> Discrepancy:
    """Find what the model lacks.

    Parameters
    ----------
    dataset : DataSet
    effects : sequence of str, optional
        Names to consider; default all that are known.
    model : {"complex", "simplified", "compliant"}, optional
        Default: compliant where the robot file has a stiffness, else complex. An effect that makes a rigid
        body bend is fitted with the compliant model.
    seed : int
    where : Executor
        Who simulates the trials (`srs_opt.parallel.executor`); the answer does not depend on it.
    report : callable, optional
        Told what is being done.
    """
    started = time.perf_counter()
    tell = report or (lambda message: None)
    clean = cleaned(dataset)
    dataset = clean.dataset
    split = split_trials(dataset.trials)
    # from the open trials alone: nothing of the sealed ones may enter a fit
    noise = noise_of(replace(dataset, trials=split.open))
    if not split.enough:
        tell("choosing what to record")
        following = first_experiment(dataset, noise, model)
        return _not_testable(dataset, split, noise.white_sd_m, started, following=following)
    quick = few_and_brief(split.open)
    trials = (*split.open, *split.sealed, *quick)
    groups = split.open, quick, split.sealed
    experiment = Experiment(Model(dataset.robot, model), trials, noise, dataset.bench, where, groups)
    candidates = _candidates(dataset, effects, experiment.model)
    search = Search(experiment, fitted_coordinates(dataset.robot), candidates, split.open, seed, tell, quick)
    found = _examine(dataset, search, split, tell, started, restricted=effects is not None)
    return replace(found, outlier_share=clean.outlier_share)


def _examine(
    dataset: DataSet,
    search: Search,
    split: Split,
    tell: Callable[[str], None],
    started: float,
    *,
    restricted: bool,
) -> Discrepancy:
    experiment, settings = search.experiment, ADEQUACY.of_body(dataset.robot.length_m)
    tell(f"calibrating on {len(split.open)} trials")
    first = search.calibrate()
    if first is None:
        why = "the robot as documented cannot be simulated under these trials' conditions"
        return _not_testable(dataset, split, experiment.sd_m, started, why)
    # before any test: to white noise's statistics colour would look like a gap
    first = search.coloured(first)
    tell(f"screening {len(search.candidates)} candidates")
    null = search.noise_aware(search.examine(first))
    if null.detection.p_value < settings.detected:
        search, null, apart = without_odd(search, null)
        split = split.without(apart)
    searched = null.detection.p_value < settings.detected
    best, fitted = search.run(null) if searched else (null, [null.hypothesis])
    # the search may have found smooth errors: calibration alone is judged under the same noise
    if search.experiment.noise != experiment.noise:
        null = null if best is null else search.examine(search.again(null.hypothesis))
        experiment = search.experiment
    first = null.hypothesis
    selection = select(best.hypothesis, fitted, split)
    tell("opening the sealed trials")
    rival = best_rival(best.hypothesis, fitted)
    opened = first.fit, best.hypothesis.fit
    gap = open_seal(experiment, *opened, split.sealed, search.seed, rival.fit if rival else None)
    odd = odd_sealed(gap, settings)
    sealed = [t for t in split.sealed if t.name not in odd]
    if odd:
        gap = open_seal(experiment, *opened, sealed, search.seed, rival.fit if rival else None)
    verdict = judge(null, best, selection, gap, settings, restricted=restricted)
    description = None
    if verdict.word == UNKNOWN and not restricted:
        tell(f"describing the gap with the {len(TERMS)} terms of the grammar")
        description = describe_gap(search, first, best.hypothesis, sealed)
    if description is not None and not description.why_not:
        verdict = Verdict(DESCRIBED, f"{description.sentence}; no listed effect does that")
        gap = description.gap
    following, seen = None, None
    if verdict.word == NO_GAP:
        seen = visible(experiment, null, search.candidates, sealed, settings)
    else:
        tell("choosing the next experiment")
        if verdict.word == DESCRIBED and description is not None:
            following = confirmation(description, first, split.open)
        else:
            following = next_experiment(experiment, rivals_of(selection, fitted, null.hypothesis), split.open)
        if following is None:
            following = _repeat(null, split, gap, settings)
    if verdict.word == DESCRIBED and description is not None and description.diagnostics is not None:
        best = description.diagnostics  # what the report shows, in a model that knows the term
        selection = Selection(best.hypothesis, (), {})
    return Discrepancy(
        dataset,
        verdict,
        split,
        null,
        best,
        selection,
        locate(null, [*fitted, *([description.best] if description else [])]),
        null.scores,
        gap,
        following,
        experiment.sd_m,
        time.perf_counter() - started,
        experiment,
        tuple(fitted),
        frozenset(search.tried),
        alike_pairs(null.linearisation, search.candidates),
        description,
        tuple(odd.items()),
        seen,
    )


def _repeat(null: Diagnostics, split: Split, gap: Gap | None, settings: AdequacySettings) -> NextExperiment:
    """Return that the trial which calibration alone misses most be repeated.

    A sealed one where the open ones show nothing.
    """
    other = "something that the model lacks"
    missed = gap.before.by_trial if gap is not None else {}
    if gap is not None and missed and null.detection.p_value >= settings.detected:
        worst = max(missed, key=lambda n: missed[n])
        track = next(track_of(t) for t in split.sealed if t.name == worst)
        count = 0 if track is None else int(np.isfinite(track).sum())
        return repeat_of(worst, count * (missed[worst] / gap.noise_floor) ** 2, other)
    misfit = misfit_by_trial(null)
    worst = max((t.name for t in split.open), key=lambda n: misfit[n])
    equations = null.linearisation.equations[worst]
    return repeat_of(worst, equations.misfit - equations.count, other)


def without_odd(search: Search, null: Diagnostics) -> tuple[Search, Diagnostics, dict[str, str]]:
    """Return the search and calibration alone without the trials that contradict all others, and these."""
    tried: dict[tuple[str, ...], tuple[Search, Hypothesis]] = {}

    def refit(names: Sequence[str]) -> Fit | None:
        rest = search.without(names)
        found = rest.calibrate()  # from the bench's values: the fit to all is bent by what is left out
        if found is None:
            return None
        tried[tuple(names)] = rest, found
        return found.fit

    odd, _ = outlying_trials(search.experiment, null.hypothesis.fit, search.trials, refit)
    if not odd:
        return search, null, odd
    rest, found = tried[tuple(odd)]
    return rest, rest.noise_aware(rest.examine(found)), odd


def _candidates(dataset: DataSet, effects: Sequence[str] | None, model: Model) -> tuple[Candidate, ...]:
    found = all_candidates(dataset.robot.links, effects)
    present = {Candidate(form_of_entry(e)).label for e in dataset.robot.effects}
    fitting = [c for c in found if model.can_bend or not c.form.effect.bends]
    return tuple(c for c in fitting if c.label not in present)


def _not_testable(
    dataset: DataSet,
    split: Split,
    sd: float,
    started: float,
    why: str | None = None,
    following: NextExperiment | None = None,
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
    return Discrepancy(dataset, verdict, split, None, None, None, (), (), None, following, sd, seconds)


__all__ = ["NO_GAP", "Discrepancy", "diagnose"]

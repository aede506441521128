"""After an unknown gap: the term of the grammar that describes it, if one does and no other does as well.

The listed effects have failed, so the gap is mostly large: calibration alone has bent the robot's values for
it, and what derivatives there say of a term can be far from what the term does. So terms are screened about
the bench's values too, the best of both screens are fitted to the start of a few trials, and the one that
leaves least is exchanged for others while that helps.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from srs_opt.calibrate.candidates import Candidate, effect_spec, entry_sd
from srs_opt.calibrate.experiment import Experiment
from srs_opt.calibrate.fit import Fit, start_point
from srs_opt.calibrate.forms import form_of_entry, forms_of
from srs_opt.discrepancy.design import NOTHING, NextExperiment, next_experiment
from srs_opt.discrepancy.diagnostics import Diagnostics, needed_gain
from srs_opt.discrepancy.hypothesis import Hypothesis
from srs_opt.discrepancy.screen import Linearisation, Score, expected_start, screen
from srs_opt.discrepancy.seal import Gap, open_seal
from srs_opt.discrepancy.search import Search
from srs_opt.discrepancy.settings import DESCRIPTION, DescriptionSettings
from srs_opt.effects import generic_effects
from srs_opt.effects.generic import TERMS, Term
from srs_opt.measurement.records import Trial


@dataclass(frozen=True)
class Description:
    """What the grammar says of a gap.

    Attributes
    ----------
    best : Hypothesis
        One term, fitted to the open trials.
    gap : Gap or None
        On the sealed trials, from calibration alone to this.
    tried : tuple of Hypothesis
        All terms that were fitted, to the start of a few trials, best first.
    why_not : str
        Why it is not believed; empty when it is.
    diagnostics : Diagnostics or None
        The best with its tests, where it is believed.
    experiment : Experiment or None
        In which it can be simulated.
    """

    best: Hypothesis
    gap: Gap | None
    tried: tuple[Hypothesis, ...]
    why_not: str
    diagnostics: Diagnostics | None = None
    experiment: Experiment | None = None

    @property
    def term(self) -> Term:
        """The term."""
        return TERMS[self.best.candidates[0].effect]

    @property
    def sentence(self) -> str:
        """What the term says, with its fitted size."""
        return _sentence(self.best)


def describe_gap(
    search: Search, null: Hypothesis, listed: Hypothesis, sealed: Sequence[Trial]
) -> Description | None:
    """Return the best description of what a search of the listed effects has left unexplained.

    Parameters
    ----------
    search : Search
        The one that failed.
    null, listed : Hypothesis
        Calibration alone, and the best set of listed effects. One that physics or the bench speaks against
        is no rival unless it leaves less.
    """
    robot = search.experiment.model.robot
    present = [Candidate(form_of_entry(e)).label for e in robot.effects]
    terms = terms_of(robot.links, present)
    experiment = search.experiment.with_generic_terms()
    own = Search(experiment, search.base, terms, search.trials, search.seed, search.report, search.quick)
    found = describe(own, null.fit, listed, sealed)
    if found is None or found.why_not:
        return found
    return replace(found, diagnostics=own.examine(found.best), experiment=experiment)


def confirmation(
    description: Description, null: Hypothesis, trials: Sequence[Trial]
) -> NextExperiment | None:
    """Return the trial or instrument that best tells a description from the next best, and where to look.

    The next best is the best term that acts on something else or elsewhere; none: calibration alone.
    """
    if description.experiment is None:
        return None
    best = description.best
    rivals = [h for h in description.tried if _says(h) != _says(best)]
    other = min(rivals, key=_left, default=null)
    found = next_experiment(description.experiment, (best, other), trials)
    if found is None:
        return None
    both = description.sentence, _sentence(other) if other.candidates else NOTHING
    return replace(found, what=f"{found.what}; and {description.term.effect.look}", separates=both)


def terms_of(links: int, present: Sequence[str] = ()) -> tuple[Candidate, ...]:
    """Return every term of the grammar at every place, but for those whose labels are `present`."""
    found = (Candidate(form) for effect in generic_effects().values() for form in forms_of(effect, links))
    return tuple(c for c in found if c.label not in present)


def describe(
    search: Search,
    null: Fit,
    listed: Hypothesis,
    sealed: Sequence[Trial],
    settings: DescriptionSettings = DESCRIPTION,
) -> Description | None:
    """Return the best description; None where no term can be fitted.

    Parameters
    ----------
    search : Search
        With the terms as candidates.
    null : Fit
        Calibration alone.
    listed : Hypothesis
        The best set of listed effects, of the same trials.
    sealed : sequence of Trial
    """
    tried = sorted(_fitted(search, null, settings), key=_left)
    fitted = [search.fit(h.candidates, h.fit.point) for h in _contenders(tried, settings)]
    whole = [h for h in fitted if h is not None]
    if not whole:
        return None
    found = min(whole, key=_left)
    if found.fit.variance_inflation == 1:  # what is left is noise: the likelihood tells them apart
        found = min((h for h in whole if h.fit.variance_inflation == 1), key=lambda h: h.deviance)
    gap = open_seal(search.experiment, null, found.fit, sealed, search.seed)
    told = {h.label for h in [*whole, listed] if _told(found, h, settings)}
    why_not = _doubt(found, gap, tried, null, listed, len(search.candidates), told, settings)
    return Description(found, gap, tuple(tried), why_not)


def _fitted(search: Search, null: Fit, settings: DescriptionSettings) -> list[Hypothesis]:
    """Return what was fitted to the start of a few trials."""
    brief = Search(search.experiment, search.base, search.candidates, search.quick, search.seed)
    first = search.try_out((), null.point)
    if first is None:
        return []
    found: dict[str, Hypothesis] = {}

    def attempt(lin: Linearisation, score: Score) -> None:
        label = score.candidate.label
        if label not in found:
            beat = min((h.deviance for h in found.values()), default=math.inf)
            h = search.try_out((score.candidate,), expected_start(lin, score), beat)
            if h is not None:
                found[label] = h

    bench = replace(first, fit=replace(first.fit, point=start_point(search.base)))
    screens = []
    for diagnostics in (brief.examine(first), brief.examine(bench)):
        screens.append([(diagnostics.linearisation, score) for score in diagnostics.scores])
    # in turn from both screens: which of them is right is not known
    for lin, score in itertools.chain.from_iterable(zip(*screens)):
        if len(found) < settings.refits:
            attempt(lin, score)
    for _ in range(settings.exchanges):
        leader = min(found.values(), key=_left, default=None)
        if leader is None or _left(leader) < settings.explained_share * _left(first):
            break
        others = [c for c in _hopeful(screens, settings) if c.label not in found]
        brief.candidates = (*leader.candidates, *others)
        lin = brief.examine(leader).linearisation
        for score in screen(lin, others, dropped=leader.candidates)[:2]:
            attempt(lin, score)
        if min(found.values(), key=_left) is leader:
            break
    return list(found.values())


def _hopeful(
    screens: Sequence[Sequence[tuple[Linearisation, Score]]], settings: DescriptionSettings
) -> list[Candidate]:
    """Return the terms of which a screen promises a share of what it does of its best."""
    found = {
        score.candidate.label: score.candidate
        for scores in screens
        for _, score in scores
        if score.improvement >= settings.promising_share * scores[0][1].improvement
    }
    return list(found.values())


def _contenders(tried: Sequence[Hypothesis], settings: DescriptionSettings) -> list[Hypothesis]:
    """Return what is fitted to all trials: the best, and one more that comes near it."""
    return [h for h in tried[:2] if _left(tried[0]) > settings.rival_share * _left(h)]


def _left(hypothesis: Hypothesis) -> float:
    """Return the misfit beyond the noise."""
    # 1e-3 keeps ratios of misfits finite where nothing is left
    return max(hypothesis.fit.misfit_ratio - 1, 1e-3)


def _told(found: Hypothesis, other: Hypothesis, settings: DescriptionSettings) -> bool:
    """Whether all open trials tell another explanation from one that leaves them nothing but noise."""
    return found.fit.variance_inflation == 1 and other.deviance - found.deviance > settings.told_deviance


def _doubt(
    found: Hypothesis,
    gap: Gap | None,
    tried: Sequence[Hypothesis],
    null: Fit,
    listed: Hypothesis,
    family: int,
    told: Collection[str],
    settings: DescriptionSettings,
) -> str:
    """Return why a description is not believed; empty when nothing is against it."""
    if null.deviance - found.deviance < needed_gain(found.candidates[0], family):
        return "it gains no more than the best of as many terms does by chance"
    lead = 1.0 if listed.candidates and listed.implausible() else settings.rival_share
    if _left(found) > lead * _left(listed) and listed.label not in told:
        return "listed effects do about as well"
    if gap is None or gap.ratio is None or gap.ratio > 1 - settings.closed_share:
        closed = 0.0 if gap is None or gap.ratio is None else 1 - gap.ratio
        return f"it closes only {closed:.0%} of the gap on the sealed trials"
    rivals = [h for h in tried if _says(h) != _says(found)]
    own = next(h for h in tried if h.label == found.label)
    near = [h for h in rivals if _left(own) > settings.rival_share * _left(h) and h.label not in told]
    if near:
        return f"{near[0].label} does about as well"
    name, off = max(found.fit.off_bench.items(), key=lambda item: abs(item[1]), default=("", 0.0))
    if abs(off) > settings.most_bench_sd:
        return f"{name} would lie {abs(off):.1f} standard deviations from its bench value"
    return ""


def _sentence(hypothesis: Hypothesis) -> str:
    candidate, fit = hypothesis.candidates[0], hypothesis.fit
    spec = effect_spec(candidate, fit.point.values)
    return TERMS[candidate.effect].sentence(spec, entry_sd(candidate.form, fit))


def _says(hypothesis: Hypothesis) -> tuple[str, int | None]:
    """Return what a description says acts, and where."""
    candidate = hypothesis.candidates[0]
    return TERMS[candidate.effect].acts, candidate.place


__all__ = ["Description", "describe", "terms_of"]

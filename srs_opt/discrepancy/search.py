"""Steps 6 and 7: refit what the screen proposes, add, drop and swap until nothing is left to explain."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from srs_opt.calibrate.candidates import Candidate
from srs_opt.calibrate.colour import coloured
from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit import start_point
from srs_opt.calibrate.fit_settings import FIT
from srs_opt.calibrate.noise import Noise
from srs_opt.calibrate.smooth_variance import smooth_part
from srs_opt.discrepancy.diagnostics import Diagnostics, explainable, explained, needed_gain
from srs_opt.discrepancy.examine import examined, linearised, screened_of
from srs_opt.discrepancy.functions import ResidualFunctions
from srs_opt.discrepancy.gap_settings import PLAUSIBILITY
from srs_opt.discrepancy.hypothesis import Hypothesis, cost, fit_hypothesis, fit_key, left_of, stuck
from srs_opt.discrepancy.promising import could_replace, promising
from srs_opt.discrepancy.screen import Score, expected_start, screen
from srs_opt.discrepancy.search_settings import SEARCH
from srs_opt.discrepancy.soft_start import soft_start
from srs_opt.discrepancy.split import brief_name
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Trial

Report = Callable[[str], None]


class Search:
    """What every step of the search needs.

    Parameters
    ----------
    experiment : Experiment
    base : sequence of Coordinate
    candidates : sequence of Candidate
    trials : sequence of Trial
        The open ones.
    quick : sequence of Trial
        What a refit is tried with before all trials are asked; nothing: all at once.
    """

    def __init__(
        self,
        experiment: Experiment,
        base: Sequence[Coordinate],
        candidates: Sequence[Candidate],
        trials: Sequence[Trial],
        seed: int = 0,
        report: Report | None = None,
        quick: Sequence[Trial] = (),
    ) -> None:
        self.experiment, self.base = experiment, tuple(base)
        self.candidates, self.trials = tuple(candidates), tuple(trials)
        self.functions = ResidualFunctions.of(self.trials)
        self.seed = seed
        self.report = report or (lambda message: None)
        self.quick = tuple(quick) or self.trials
        self.screened = screened_of(self.trials, self.quick)
        self.deepest = SEARCH.most_effects
        self._fits: dict[tuple[frozenset[str], bool], Hypothesis] = {}
        self._earlier: list[Hypothesis] = []  # under another noise
        self._examined: Diagnostics | None = None  # last

    @property
    def fitted(self) -> list[Hypothesis]:
        """Return what was fitted to all open trials."""
        return [h for (_, quick), h in self._fits.items() if not quick]

    @property
    def tried(self) -> set[str]:
        """Labels of everything that was refitted, also to a part of the trials."""
        return {h.label for h in self._fits.values()}

    def without(self, names: Sequence[str]) -> Search:
        """Return a search of its own that some trials are kept from."""
        rest = [t for t in self.trials if t.name not in names]
        gone = {*names, *map(brief_name, names)}
        quick = [t for t in self.quick if t.name not in gone]
        return Search(self.experiment, self.base, self.candidates, rest, self.seed, quick=quick)

    def fit(
        self,
        candidates: Sequence[Candidate],
        start: Point,
        iterations: int | None = None,
        beat: float = math.inf,
        *,
        quick: bool = False,
        near: float | None = None,
    ) -> Hypothesis | None:
        """Fit a set of effects; None where the motion cannot be simulated."""
        quick = quick and self.quick != self.trials
        trials = self.quick if quick else self.trials
        key = fit_key(candidates, quick)
        near = SEARCH.fine_gain_share if near is None else near
        known = self._fits.get(key)
        if known is not None and known.fit.converged:
            return known
        label = " + ".join(c.label for c in candidates)
        on = f"the start of {len(trials)} trials" if quick else f"{len(trials)} trials"
        self.report(f"refit on {on}: {label}" if label else "calibration alone")
        try:
            found = fit_hypothesis(
                self.experiment, self.base, candidates, start, trials, iterations, beat, near, rough=quick
            )
        except NoAnswerError:
            return None
        # another start may end in a worse optimum: the better one is kept
        if known is None or found.deviance < known.deviance:
            self._fits[key] = found
        return self._fits[key]

    def try_out(
        self, candidates: Sequence[Candidate], start: Point, beat: float = math.inf
    ) -> Hypothesis | None:
        """Fit a set of effects roughly, to the start of a few trials."""
        return self.fit(
            candidates, start, SEARCH.quick_iterations, beat, quick=True, near=SEARCH.rough_gain_share
        )

    def calibrate(self, start: Point | None = None, give_up: float = math.inf) -> Hypothesis | None:
        """Fit the model without effects, first to the start of a few trials.

        Where even there the noise must be taken for `give_up` times as large, that is the answer.
        """
        start = start_point(self.base) if start is None else start
        first = self.try_out((), start)
        if first is not None:
            if first.fit.variance_inflation > give_up:
                return first
            start = first.fit.point
        return self.fit((), start, SEARCH.null_iterations, near=SEARCH.rough_gain_share)

    def coloured(self, calibrated: Hypothesis) -> Hypothesis:
        """Return calibration alone under the noise that its residuals show to be correlated in time."""
        residuals = self.experiment.residuals(self.trials, calibrated.fit.point)
        noise = coloured(self.experiment.noise, self.trials, residuals)
        return calibrated if noise == self.experiment.noise else self._under(noise, calibrated)

    def _under(self, noise: Noise, hypothesis: Hypothesis) -> Hypothesis:
        """Go on under another noise; return a hypothesis fitted anew."""
        self.report(f"noise: {noise.in_words}")
        self._earlier += self.fitted
        self.experiment = self.experiment.with_noise(noise)
        self._fits, self._examined = {}, None
        return self.fit(hypothesis.candidates, hypothesis.fit.point) or hypothesis

    def again(self, hypothesis: Hypothesis) -> Hypothesis:
        """Return a hypothesis under the noise assumed by now."""
        return self.fit(hypothesis.candidates, hypothesis.fit.point) or hypothesis

    def examine(self, hypothesis: Hypothesis, *, stale: bool = False) -> Diagnostics:
        """Linearise about a fitted hypothesis, test what is left and screen what could explain it.

        With `stale` the derivatives of the last examination serve, if it was of the same effects.
        """
        known = self._examined
        if known is not None and known.hypothesis is hypothesis:
            return known
        about = self.trials, self.screened, self.functions
        lin = linearised(self.experiment, hypothesis, self.candidates, *about, stale=stale)
        shared = self.functions.repeated_sd(self.experiment.noise)
        self._examined = examined(lin, hypothesis, self.candidates, self.functions, shared, self.seed)
        return self._examined

    def noise_aware(self, diagnostics: Diagnostics) -> Diagnostics:
        """Return a hypothesis examined anew under smooth errors, if small ones explain what it leaves."""
        now, lin = self.experiment.noise, diagnostics.linearisation
        if diagnostics.adequate or now.smooth or lin.variance_inflation > FIT.unexplained_inflation:
            return diagnostics
        amplitudes = self.functions.amplitudes(self.trials, len(lin.coordinates))
        noise = smooth_part(now, lin.telling, amplitudes, lin.coordinates, lin.point)
        if noise == now:
            return diagnostics
        found = self._under(noise, diagnostics.hypothesis)
        return self.examine(found, stale=found.close_to(diagnostics.hypothesis))

    def _with_rivals(self) -> list[Hypothesis]:
        """Return what was fitted, and the best that were fitted under another noise fitted anew."""
        earlier = sorted((h for h in self._earlier if h.candidates), key=cost)[: SEARCH.most_refitted]
        for h in [e for e in earlier if cost(e) < cost(earlier[0]) + SEARCH.refitted_deviance]:
            self.again(h)
        return self.fitted

    def significant(self, score: Score) -> bool:
        """Whether a gain is too large for chance among all candidates."""
        return score.improvement > needed_gain(score.candidate, len(self.candidates))

    def run(self, null: Diagnostics) -> tuple[Diagnostics, list[Hypothesis]]:
        """Return the best set of effects, examined, and everything that was refitted."""
        current, ended = self._begun(null)
        for _ in range(0 if ended else SEARCH.rounds):
            depth = len(current.hypothesis.candidates)
            if depth >= self.deepest:
                break
            better = self._refit(
                current, promising(current, depth, len(self.candidates)), SEARCH.refits_by_effects[depth]
            )
            better = self._swapped(current, better)
            if better is None or not self._worth(better, current.hypothesis):
                break
            before, current = current, self._pruned(self.examine(self._polished(better)))
            current = self.noise_aware(current)
            again = current.hypothesis.label == before.hypothesis.label
            idle = stuck(before.hypothesis, current.hypothesis) and not explainable(current)
            if again or idle or self._settled(null, current):
                break
        return current, self._with_rivals()

    def _begun(self, null: Diagnostics) -> tuple[Diagnostics, bool]:
        """Return what a search of the start of a few trials finds, fitted to all; whether that is the end.

        It takes a third of the time, and most gaps that it cannot close are not closed with more data either.
        """
        if self.quick == self.trials:
            return null, False
        brief = Search(self.experiment, self.base, self.candidates, self.quick, self.seed, self.report)
        brief.deepest = SEARCH.most_effects_brief
        brief._fits = {(names, False): h for (names, quick), h in self._fits.items() if quick}
        first = brief.calibrate(null.hypothesis.fit.point)
        if first is None:
            return null, False
        start = brief.examine(first)
        best, fitted = brief.run(start)
        if brief.experiment.noise == self.experiment.noise:
            self._fits |= {(names, True): h for (names, _), h in brief._fits.items()}
        near = [best.hypothesis]
        if brief._settled(start, best):  # else it has no rivals: it explains nothing yet
            most, limit = len(best.hypothesis.candidates), cost(best.hypothesis) + 2 * SEARCH.rival_deviance
            near = [h for h in fitted if 0 < len(h.candidates) <= most and cost(h) < limit]
        better = self._best_of_whole(near) if best.hypothesis.candidates else None
        if better is None or not self._worth(better, null.hypothesis):
            return null, False
        current = self.noise_aware(self._pruned(self.examine(self._polished(better))))
        hopeless = left_of(start.hypothesis, best.hypothesis) > SEARCH.hopeless_share and not explainable(
            current
        )
        return current, hopeless or self._settled(null, current)

    def _best_of_whole(self, tried: Sequence[Hypothesis]) -> Hypothesis | None:
        """Return the best of some hypotheses when they are fitted to all trials."""
        whole = [self.fit(h.candidates, h.fit.point) for h in tried]
        return min((h for h in whole if h is not None), key=cost, default=None)

    def _polished(self, hypothesis: Hypothesis) -> Hypothesis:
        """Return a hypothesis that explains the data with its fit carried on, where that had not ended."""
        fit = hypothesis.fit
        if fit.converged or fit.variance_inflation > FIT.unexplained_inflation:
            return hypothesis
        return self.fit(hypothesis.candidates, fit.point, SEARCH.polish_iterations) or hypothesis

    def _settled(self, null: Diagnostics, current: Diagnostics) -> bool:
        """Whether there is nothing left to look for.

        What friction's smoothing may have left does not count, unless the fit had to go far from physics or
        the bench for it: two of three effects can come that near.
        """
        return current.adequate or (explained(null, current) and not current.hypothesis.implausible())

    def _swapped(self, current: Diagnostics, added: Hypothesis | None) -> Hypothesis | None:
        """Return the better of `added` and the best exchange of one effect for another."""
        lin, have = current.linearisation, current.hypothesis.candidates
        best = added
        for dropped in have:
            others = [k for k in self.candidates if k not in have]
            scores = screen(lin, others, dropped=(dropped,))
            if not scores or not self.significant(scores[0]):
                continue
            start = expected_start(lin, scores[0])
            rest = tuple(c for c in have if c is not dropped)
            exchanged = (*rest, scores[0].candidate)
            rival = current.hypothesis if best is None else best
            limit = self._tried_out(rival) + 2 * SEARCH.rival_deviance
            tried = self.try_out(exchanged, start, limit)
            if tried is None or cost(tried) > limit:
                continue
            swapped = self.fit(exchanged, tried.fit.point, beat=rival.deviance)
            if swapped is not None and (best is None or cost(swapped) < cost(best)):
                best = swapped
        return best

    def _tried_out(self, hypothesis: Hypothesis) -> float:
        """Return what the start of a few trials says against a hypothesis that was fitted to all."""
        known = self._fits.get(fit_key(hypothesis.candidates, True))
        tried = known or self.try_out(hypothesis.candidates, hypothesis.fit.point)
        return math.inf if tried is None else cost(tried)

    def _refit(self, current: Diagnostics, proposals: list[Score], most: int) -> Hypothesis | None:
        """Refit proposals on the start of a few trials, best first; return the best fit to all of them.

        Once one explains the data, only those that act alike can be its rivals. A body that begins to bend
        beside other effects is tried last, where nothing else gets on: it has had its chance alone.
        """
        found: list[Hypothesis] = []
        have = current.hypothesis.candidates
        explains: Hypothesis | None = None
        bending = [s for s in proposals if s.candidate.form.effect.bends]
        others = [s for s in proposals if s not in bending][: 2 * most - len(bending)]
        before = len(others) if have else SEARCH.refits_before_bending
        for score in (*others[:before], *bending, *others[before:]):
            if have and score in bending and self._makes_progress(found, current):
                continue
            if explains is not None and not could_replace(self.examine(explains), score.candidate):
                continue
            start = self._start(current, score)
            beat = min((h.deviance for h in found), default=math.inf)
            if score in bending and not have:
                beat = math.inf  # it begins far off, and explains nothing until it comes near
            hypothesis = self.try_out((*have, score.candidate), start, beat)
            if hypothesis is not None and score not in bending and self._lost(hypothesis, current):
                nearer = expected_start(current.linearisation, score, SEARCH.restart_share)
                hypothesis = self.try_out((*have, score.candidate), nearer, beat)
            if hypothesis is not None:
                found.append(hypothesis)
                if hypothesis.fit.variance_inflation == 1 and explains is None and self.quick == self.trials:
                    explains = hypothesis
            settled = found and min(h.fit.variance_inflation for h in found) == 1
            if len(found) >= most and (settled or len(found) >= 2 * most):
                break
        if not found:
            return None
        found.sort(key=cost)
        near = [h for h in found if cost(h) < cost(found[0]) + 2 * SEARCH.rival_deviance]
        return self._best_of_whole(near)

    def _makes_progress(self, found: Sequence[Hypothesis], current: Diagnostics) -> bool:
        """Whether one of some refits leaves less of the misfit than counts as progress."""
        without = self._fits.get(fit_key(current.hypothesis.candidates, self.quick != self.trials))
        return without is not None and any(left_of(without, h) < SEARCH.progress_share for h in found)

    def _lost(self, added: Hypothesis, current: Diagnostics) -> bool:
        """Whether a refit ended worse than without the effect that it adds, which it holds at size zero.

        Derivatives about a fit that is far off promise too much; begun there, a fit may not find back.
        """
        without = self._fits.get(fit_key(current.hypothesis.candidates, self.quick != self.trials))
        return without is not None and added.deviance > without.deviance

    def _start(self, current: Diagnostics, score: Score) -> Point:
        """Return where to begin a refit with a candidate added."""
        if score.candidate.form.effect.bends:
            about = self.experiment, self.base, score.candidate
            return soft_start(*about, current.hypothesis, self.quick)
        return expected_start(current.linearisation, score)

    def _worth(self, better: Hypothesis, current: Hypothesis) -> bool:
        gain = current.deviance - better.deviance
        return gain > needed_gain(better.candidates[-1], len(self.candidates))

    def _pruned(self, current: Diagnostics) -> Diagnostics:
        """Drop effects that turn out to be superfluous, or too small to be themselves, beside the others."""
        have = current.hypothesis.candidates
        if len(have) < 2:
            return current
        small = [c for c in have if current.hypothesis.relative_size(c) < PLAUSIBILITY.least_size]
        if small and len(small) < len(have):
            rest = tuple(c for c in have if c not in small)
            smaller = self.fit(rest, current.hypothesis.fit.point)
            return current if smaller is None else self._pruned(self.examine(smaller))
        # the last was just added because its gain was significant
        for dropped in have[:-1]:
            if current.hypothesis.firmness(dropped) > SEARCH.certain_sd:
                continue
            rest = tuple(c for c in have if c is not dropped)
            allowed = needed_gain(dropped, len(self.candidates))
            beat = current.hypothesis.deviance + allowed
            smaller = self.fit(rest, current.hypothesis.fit.point, beat=beat)
            if smaller is not None and smaller.deviance < beat:
                return self._pruned(self.examine(smaller))
        return current

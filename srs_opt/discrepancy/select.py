"""Step 7: which sets of effects the data cannot tell from the best; a check by trial-blocked prediction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.calibrate.fit import Fit
from srs_opt.calibrate.normal_equations import bounded_solve
from srs_opt.calibrate.objective import priors
from srs_opt.discrepancy.hypothesis import Hypothesis, cost
from srs_opt.discrepancy.search_settings import SEARCH
from srs_opt.discrepancy.split import Split


@dataclass(frozen=True)
class Selection:
    """The best set and its rivals.

    Attributes
    ----------
    best : Hypothesis
    rivals : tuple of Hypothesis
        Within reach of the best, by other names.
    predictive : dict
        Label -> mean and standard error, over trials, of the deviance per trial when the trial's fold was
        left out of the fit, less the best hypothesis'.
    change : float
        The largest change of an effect's size, over itself, when a fold of trials is left out.
    """

    best: Hypothesis
    rivals: tuple[Hypothesis, ...]
    predictive: dict[str, tuple[float, float]]
    change: float = 0.0


def select(best: Hypothesis, fitted: Sequence[Hypothesis], split: Split) -> Selection:
    """Return the rivals of `best` among all fitted hypotheses.

    A rival explains the data about as well (deviance within `rival_deviance`, counting 2 per parameter),
    under another name, without leaving physics or the bench behind, and holds no effect beyond those of a
    smaller rival. Where the best leaves a misfit, differences are judged as if that were noise too.
    """
    own, reach = cost(best), SEARCH.rival_deviance * best.fit.variance_inflation
    near = [
        h
        for h in fitted
        if h.names != best.names and h.candidates and cost(h) < own + reach and not h.implausible()
    ]
    near.sort(key=cost)
    rivals: list[Hypothesis] = []
    for h in near:
        names = set(h.names)
        smaller = [set(r.names) for r in (best, *rivals)]
        if names not in smaller and not any(s < names for s in smaller):
            rivals.append(h)
    predictive = _predictive([best, *rivals], split)
    return Selection(best, tuple(rivals), predictive, _change(best, split.folds))


def best_rival(best: Hypothesis, fitted: Sequence[Hypothesis]) -> Hypothesis | None:
    """Return the best plausible set of effects that neither holds all of the best nor is a part of it."""
    names = set(best.names)
    others = [h for h in fitted if h.candidates and not (names <= set(h.names) or set(h.names) <= names)]
    others = [h for h in others if not h.implausible_size()] or others
    return min(others, key=cost, default=None)


def _predictive(hypotheses: Sequence[Hypothesis], split: Split) -> dict[str, tuple[float, float]]:
    scores = {h.label: left_out_deviance(h, split.folds) for h in hypotheses}
    reference = scores[hypotheses[0].label]
    found = {}
    for label, score in scores.items():
        difference = score - reference
        error = (
            float(difference.std(ddof=1) / np.sqrt(difference.size)) if difference.size > 1 else float("nan")
        )
        found[label] = (float(difference.mean()), error)
    return found


def left_out_deviance(hypothesis: Hypothesis, folds: Sequence[Sequence[str]]) -> np.ndarray:
    """Return every trial's deviance under the fit without its fold (one linear step from the full fit)."""
    parts = {
        name: g.eliminated(hypothesis.fit.variance_inflation) for name, g in hypothesis.fit.equations.items()
    }
    found = []
    for fold in folds:
        # (step, -1)' M (step, -1) is the quadratic form's deviance after the step
        step = np.append(_step_without(hypothesis.fit, fold), -1.0)
        found += [float(step @ parts[name].matrix @ step) + parts[name].log_det for name in fold]
    return np.array(found)


def _step_without(fit: Fit, fold: Sequence[str]) -> np.ndarray:
    """Return where the fit would go without some trials, one linear step from where it is."""
    precision, offset = priors(fit.coordinates, fit.point)
    now = np.array([fit.point.values[c.name] for c in fit.coordinates])
    lower = np.array([c.lower for c in fit.coordinates]) - now
    rest = np.sum(
        [g.eliminated(fit.variance_inflation).matrix for n, g in fit.equations.items() if n not in fold],
        axis=0,
    )
    return bounded_solve(rest, range(len(fit.coordinates)), precision, offset, lower).step


def _change(hypothesis: Hypothesis, folds: Sequence[Sequence[str]]) -> float:
    """Return the largest change of an effect's size over itself when a fold is left out."""
    names = [c.name for c in hypothesis.fit.coordinates]
    largest = 0.0
    for fold in folds if hypothesis.candidates else ():
        step = _step_without(hypothesis.fit, fold)
        for candidate in hypothesis.candidates:
            moved = np.array([step[names.index(c.name)] / c.typical for c in candidate.sizes])
            size = hypothesis.relative_size(candidate)
            largest = max(largest, float(np.linalg.norm(moved)) / max(size, 1e-12))
    return largest

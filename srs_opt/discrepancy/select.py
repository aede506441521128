"""Step 7: which sets of effects the data cannot tell from the best; a check by trial-blocked prediction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.calibrate.gram import bounded_solve
from srs_opt.calibrate.objective import priors
from srs_opt.discrepancy.hypothesis import Hypothesis
from srs_opt.discrepancy.search import RIVAL
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
    """

    best: Hypothesis
    rivals: tuple[Hypothesis, ...]
    predictive: dict[str, tuple[float, float]]


def select(best: Hypothesis, fitted: Sequence[Hypothesis], split: Split) -> Selection:
    """Return the rivals of `best` among all fitted hypotheses.

    A rival explains the data about as well (deviance within RIVAL, counting 2 per parameter), under another
    name, without leaving physics or the bench behind, and holds no effect beyond those of a smaller rival.
    """
    own = best.deviance + 2 * best.parameters
    near = [
        h
        for h in fitted
        if h.names != best.names
        and h.candidates
        and h.deviance + 2 * h.parameters < own + RIVAL
        and not h.implausible()
    ]
    near.sort(key=lambda h: h.deviance + 2 * h.parameters)
    rivals: list[Hypothesis] = []
    for h in near:
        names = set(h.names)
        smaller = [set(r.names) for r in (best, *rivals)]
        if names not in smaller and not any(s < names for s in smaller):
            rivals.append(h)
    predictive = _predictive([best, *rivals], split)
    return Selection(best, tuple(rivals), predictive)


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
    fit = hypothesis.fit
    precision, offset = priors(fit.coordinates, fit.point)
    now = np.array([fit.point.values[c.name] for c in fit.coordinates])
    lower = np.array([c.lower for c in fit.coordinates]) - now
    parts = {name: g.eliminated(fit.temper) for name, g in fit.grams.items()}
    found = []
    for fold in folds:
        rest = np.sum([e.matrix for name, e in parts.items() if name not in fold], axis=0)
        step = np.append(
            bounded_solve(rest, range(len(fit.coordinates)), precision, offset, lower).step, -1.0
        )
        found += [float(step @ parts[name].matrix @ step) + parts[name].log_det for name in fold]
    return np.array(found)

"""A hypothesis: the model with some effects added, fitted to the open trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from srs_opt.calibrate.candidates import Candidate, effect_spec
from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit import Fit, fit
from srs_opt.discrepancy.gap_settings import PLAUSIBILITY
from srs_opt.discrepancy.search_settings import SEARCH
from srs_opt.measurement.records import Trial


@dataclass(frozen=True)
class Hypothesis:
    """Effects and their fit.

    Attributes
    ----------
    candidates : tuple of Candidate
        In the order in which they were added.
    fit : Fit
    """

    candidates: tuple[Candidate, ...]
    fit: Fit

    @property
    def names(self) -> tuple[str, ...]:
        """Effects, sorted, without their places."""
        return tuple(sorted({c.effect for c in self.candidates}))

    @property
    def label(self) -> str:
        """Effects with their places."""
        return " + ".join(c.label for c in self.candidates) or "no effect"

    @property
    def parameters(self) -> int:
        """Number of coordinates that the effects add."""
        return sum(len(c.coordinates) for c in self.candidates)

    @property
    def deviance(self) -> float:
        """-2 log posterior of the fit."""
        return self.fit.deviance

    def relative_size(self, candidate: Candidate) -> float:
        """Return an effect's fitted size over its typical one."""
        values = [self.fit.point.values[c.name] / c.typical for c in candidate.sizes]
        return float(np.linalg.norm(values))

    def firmness(self, candidate: Candidate) -> float:
        """Return how many standard deviations an effect's fitted size lies from zero."""
        sd = self.fit.sd
        return max(abs(self.fit.point.values[c.name]) / max(sd[c.name], 1e-300) for c in candidate.sizes)

    def implausible(self) -> str:
        """Return what physics or the bench has against the fitted values; empty when nothing."""
        return self.implausible_size() or self.against_the_bench()

    def implausible_size(self) -> str:
        """Return which effect would have an unlikely size; empty when none."""
        for candidate in self.candidates:
            size = self.relative_size(candidate)
            if size > PLAUSIBILITY.most_size:
                return f"{candidate.label} would have to be {size:.1f} times its typical size"
            if size < PLAUSIBILITY.least_size and len(self.candidates) > 1:
                return f"{candidate.label} would be only {size:.2f} of its typical size"
        return ""

    def against_the_bench(self) -> str:
        """Return which calibrated value would lie far from its bench value; empty when none."""
        for name, off in self.fit.off_bench.items():
            if abs(off) > PLAUSIBILITY.most_bench_sd:
                return f"{name} would lie {abs(off):.1f} standard deviations from its bench value"
        return ""

    def close_to(self, earlier: Hypothesis) -> bool:
        """Whether the fit lies within what it is known to of an earlier one: derivatives hardly differ."""
        was, now = earlier.fit.point.values, self.fit.point.values
        return all(abs(now[n] - was[n]) <= sd for n, sd in self.fit.sd.items())

    def specs(self) -> list[dict[str, Any]]:
        """Return the effects as entries of a robot file."""
        return [effect_spec(c, self.fit.point.values) for c in self.candidates]


def fit_hypothesis(
    experiment: Experiment,
    base: Sequence[Coordinate],
    candidates: Sequence[Candidate],
    start: Point,
    trials: Sequence[Trial],
    iterations: int | None = None,
    beat: float = math.inf,
    near: float = 0.0,
    *,
    rough: bool = False,
) -> Hypothesis:
    """Fit the base coordinates together with the effects of `candidates`; `near` and `rough` as for `fit`."""
    coordinates = (*base, *(c for k in candidates for c in k.coordinates))
    iterations = SEARCH.iterations if iterations is None else iterations
    found = fit(experiment, coordinates, start, trials, iterations, beat=beat, near=near, rough=rough)
    return Hypothesis(tuple(candidates), found)


def fit_key(candidates: Sequence[Candidate], quick: bool) -> tuple[frozenset[str], bool]:
    """Return what tells a fit from others: its effects in any order, and whether to a part of the trials."""
    return frozenset(c.label for c in candidates), quick


def cost(hypothesis: Hypothesis) -> float:
    """Return the deviance, counting 2 per parameter."""
    # Akaike's criterion
    return hypothesis.deviance + 2 * hypothesis.parameters


def left_of(before: Hypothesis, after: Hypothesis) -> float:
    """Return the share of a misfit beyond the noise that is left."""
    return (after.fit.misfit_ratio - 1) / max(before.fit.misfit_ratio - 1, 1e-9)


def stuck(before: Hypothesis, after: Hypothesis) -> bool:
    """Whether further effects reduce the misfit too little: what is missing is none of them."""
    left = left_of(before, after)
    return (
        len(after.candidates) > 1
        and after.fit.misfit_ratio > SEARCH.stuck_misfit_ratio
        and left > SEARCH.progress_share
    )

"""A hypothesis with its tests: what is left, what could explain it, and whether that is enough."""

from __future__ import annotations

from dataclasses import dataclass

from srs_opt.calibrate.candidates import Candidate
from srs_opt.calibrate.objective import excess_of
from srs_opt.discrepancy.detect import Detection
from srs_opt.discrepancy.functions import Group
from srs_opt.discrepancy.hypothesis import Hypothesis
from srs_opt.discrepancy.screen import Linearisation, Score

ADEQUATE = 0.01  # level at which a fitted model is rejected
# The smoothing of friction is numerical, not physical, and long data sets resolve the difference. What is
# left of a gap is put down to it while it is this share of the noise's variance and of the gap's, and asks
# for nothing known at a size that matters: gaits near a change of theirs show a thousandth of a wheel's toe.
OF_NOISE, OF_GAP = 0.02, 0.01
TELLING = 0.1  # of an effect's typical size
PROMISED = 0.5  # share of what is left that an effect must promise to close for a search to go on
FALSE_NAME = 0.002  # family-wise level for adding an effect


@dataclass(frozen=True)
class Diagnostics:
    """A hypothesis with its tests.

    Attributes
    ----------
    hypothesis : Hypothesis
    linearisation : Linearisation
        Over all candidates and the residual functions.
    detection : Detection
        Of what is left.
    groups : tuple of Group
    scores : tuple of Score
        What adding each candidate would gain.
    """

    hypothesis: Hypothesis
    linearisation: Linearisation
    detection: Detection
    groups: tuple[Group, ...]
    scores: tuple[Score, ...]

    @property
    def adequate(self) -> bool:
        """Whether nothing is left beyond noise and scatter."""
        return self.detection.p_value > ADEQUATE


def explained(null: Diagnostics, diagnostics: Diagnostics) -> bool:
    """Whether nothing is left of the gap, or no more than the smoothing of friction can leave."""
    if diagnostics.adequate:
        return True
    family = len(diagnostics.scores)
    if any(
        s.relative_size >= TELLING and s.improvement > needed_gain(s.candidate, family)
        for s in diagnostics.scores
    ):
        return False
    left = diagnostics.hypothesis.fit.misfit_ratio - 1
    gap = null.hypothesis.fit.misfit_ratio - 1
    return left < OF_NOISE and left < OF_GAP * gap


def explainable(diagnostics: Diagnostics) -> bool:
    """Whether one more known effect, at a size that matters, promises to close half of what is left.

    As the linearisation has it, the noise taken for as large as the misfit makes it.
    """
    fit = diagnostics.hypothesis.fit
    left = excess_of(fit.equations) / fit.variance_inflation
    family = len(diagnostics.scores)
    return any(
        s.relative_size >= TELLING and s.improvement > max(PROMISED * left, needed_gain(s.candidate, family))
        for s in diagnostics.scores
    )


def needed_gain(candidate: Candidate, family: int) -> float:
    """Return the drop of the deviance that the best of `family` candidates reaches by chance once in 500."""
    from scipy.special import chdtri

    return float(chdtri(len(candidate.coordinates), FALSE_NAME / max(family, 1)))

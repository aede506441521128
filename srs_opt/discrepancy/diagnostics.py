"""A hypothesis with its tests: what is left, what could explain it, and whether that is enough."""

from __future__ import annotations

from dataclasses import dataclass

from srs_opt.calibrate.candidates import Candidate
from srs_opt.calibrate.objective import excess_of
from srs_opt.discrepancy.detect import Detection
from srs_opt.discrepancy.functions import Group
from srs_opt.discrepancy.gap_settings import DETECTION, EXPLANATION
from srs_opt.discrepancy.hypothesis import Hypothesis
from srs_opt.discrepancy.screen import Linearisation, Score


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
        return self.detection.p_value > DETECTION.adequate_level


def explained(null: Diagnostics, diagnostics: Diagnostics) -> bool:
    """Whether nothing is left of the gap, or no more than the smoothing of friction can leave."""
    if diagnostics.adequate:
        return True
    family = len(diagnostics.scores)
    if any(
        s.relative_size >= EXPLANATION.telling_size and s.improvement > needed_gain(s.candidate, family)
        for s in diagnostics.scores
    ):
        return False
    left = diagnostics.hypothesis.fit.misfit_ratio - 1
    gap = null.hypothesis.fit.misfit_ratio - 1
    return left < EXPLANATION.noise_share and left < EXPLANATION.gap_share * gap


def explainable(diagnostics: Diagnostics) -> bool:
    """Whether one more known effect, at a size that matters, promises to close half of what is left.

    As the linearisation has it, the noise taken for as large as the misfit makes it.
    """
    fit = diagnostics.hypothesis.fit
    left = excess_of(fit.equations) / fit.variance_inflation
    family = len(diagnostics.scores)
    return any(
        s.relative_size >= EXPLANATION.telling_size
        and s.improvement > max(EXPLANATION.promised_share * left, needed_gain(s.candidate, family))
        for s in diagnostics.scores
    )


def needed_gain(candidate: Candidate, family: int) -> float:
    """Return the drop of the deviance that the best of `family` candidates reaches by chance once in 500."""
    from scipy.special import chdtri

    # Bonferroni over the family; a candidate's gain is chi squared with one degree of freedom per coordinate
    return float(chdtri(len(candidate.coordinates), DETECTION.name_level / max(family, 1)))

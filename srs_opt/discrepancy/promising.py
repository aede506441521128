"""Which candidates of a screen deserve a refit."""

from __future__ import annotations

from srs_opt.calibrate.candidates import Candidate
from srs_opt.calibrate.fit_settings import FIT
from srs_opt.discrepancy.alike import Angles
from srs_opt.discrepancy.diagnostics import Diagnostics, needed_gain
from srs_opt.discrepancy.gap_settings import EXPLANATION
from srs_opt.discrepancy.screen import Score
from srs_opt.discrepancy.search_settings import SCREEN


def promising(current: Diagnostics, depth: int, family: int) -> list[Score]:
    """Return those of `family` candidates that deserve a refit beside `depth` effects, best first.

    Last come the effects of which derivatives about a fit that is far off say nothing, and which cost most.
    """
    inflation = current.hypothesis.fit.variance_inflation
    scores = [
        s
        for s in current.scores
        if s.improvement > needed_gain(s.candidate, family)
        or s.improvement * inflation > SCREEN.relevant_deviance
    ]
    if inflation < FIT.unexplained_inflation:  # expected sizes can be believed
        scores = [s for s in scores if s.relative_size >= EXPLANATION.telling_size]
    far = inflation > 1  # nearer, a little bending's derivatives hold as all others do
    soft = [s for s in current.scores if far and s.candidate.form.effect.bends]
    scores = [s for s in scores if s not in soft]
    if not scores:
        return soft
    best = scores[0].improvement
    limit = min(
        SCREEN.contender_share * best, max(best - SCREEN.near_deviance, SCREEN.least_contender_share * best)
    )
    chosen = [s for s in scores if s.improvement >= limit]
    if depth == 0:
        angles = Angles(current.linearisation)
        for s in scores:
            if s not in chosen and s.improvement > SCREEN.similar_share * best:
                angle = angles.between(scores[0].candidate, s.candidate)
                if angle is not None and angle < SCREEN.similar_rad:
                    chosen.append(s)
    return [*chosen, *soft]


def could_replace(diagnostics: Diagnostics, candidate: Candidate) -> bool:
    """Whether a candidate could do about what the effects of a hypothesis that explains the data do."""
    have = diagnostics.hypothesis.candidates
    angles = Angles(diagnostics.linearisation, have)
    found = (angles.between(a, candidate) for a in have if a is not candidate)
    return any(angle is not None and angle < SCREEN.similar_rad for angle in found)

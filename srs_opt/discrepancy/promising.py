"""Which candidates of a screen deserve a refit."""

from __future__ import annotations

from srs_opt.calibrate.candidates import Candidate
from srs_opt.calibrate.fit import FAR_OFF
from srs_opt.discrepancy.alike import Angles
from srs_opt.discrepancy.diagnostics import TELLING, Diagnostics, needed_gain
from srs_opt.discrepancy.screen import Score

CONTENDER = 0.45  # share of the best expected gain that earns a refit
_NEAR = 40.0  # or this little behind it
# angle at which a member of a pair of look-alikes that is well behind in the screen is refitted all the same:
# far from the linearisation's point an effect does up to sin^2 of it of something else
KIN_RAD = 0.8


def promising(current: Diagnostics, depth: int, family: int) -> list[Score]:
    """Return those of `family` candidates that deserve a refit beside `depth` effects, best first.

    Last come the effects of which slopes about a fit that is far off say nothing, and which cost most.
    """
    inflation = current.hypothesis.fit.variance_inflation
    scores = [
        s
        for s in current.scores
        if s.improvement > needed_gain(s.candidate, family) or s.improvement * inflation > 60
    ]
    if inflation < FAR_OFF:  # expected sizes can be believed
        scores = [s for s in scores if s.relative_size >= TELLING]
    far = inflation > 1  # nearer, a little bending's derivatives hold as all others do
    leaps = [s for s in current.scores if far and s.candidate.form.effect.bends]
    scores = [s for s in scores if s not in leaps]
    if not scores:
        return leaps
    best = scores[0].improvement
    limit = min(CONTENDER * best, max(best - _NEAR, 0.25 * best))
    chosen = [s for s in scores if s.improvement >= limit]
    if depth == 0:
        angles = Angles(current.linearisation)
        for s in scores:
            if s not in chosen and s.improvement > 0.2 * best:
                angle = angles.between(scores[0].candidate, s.candidate)
                if angle is not None and angle < KIN_RAD:
                    chosen.append(s)
    return [*chosen, *leaps]


def akin(diagnostics: Diagnostics, candidate: Candidate) -> bool:
    """Whether a candidate could do about what the effects of a hypothesis that explains the data do."""
    have = diagnostics.hypothesis.candidates
    angles = Angles(diagnostics.linearisation, have)
    found = (angles.between(a, candidate) for a in have if a is not candidate)
    return any(angle is not None and angle < KIN_RAD for angle in found)

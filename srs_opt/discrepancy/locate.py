"""Step 4: where the model and the data part, and against what; reported even when no name follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from srs_opt.calibrate.objective import sum_eliminated
from srs_opt.discrepancy.diagnostics import Diagnostics
from srs_opt.discrepancy.gap_settings import DETECTION, EXPLANATION
from srs_opt.discrepancy.hypothesis import Hypothesis

STAGES = {
    "actuation": "valves to curvature",
    "body": "geometry of the body",
    "ground": "curvature to motion (ground)",
    "tether": "curvature to motion (tether)",
    "room": "place in the room",
    "measurement": "camera",
    "clock": "clock",
}


@dataclass(frozen=True)
class Place:
    """One line of the answer's `located`.

    Attributes
    ----------
    where, against : str
    score : float
        Improvement of the deviance per degree of freedom.
    p_value : float
        Adjusted for the family.
    """

    where: str
    against: str
    score: float
    p_value: float


def locate(diagnostics: Diagnostics, fitted: Sequence[Hypothesis] = (), most: int = 8) -> tuple[Place, ...]:
    """Return where the gap is, then where it shows most, best first.

    Parameters
    ----------
    diagnostics : Diagnostics
        Calibration alone.
    fitted : sequence of Hypothesis
        What was fitted to close the gap: effects, or terms that describe it.
    """
    return (*stages(diagnostics.hypothesis, fitted), *left_places(diagnostics)[:most])


def left_places(diagnostics: Diagnostics) -> list[Place]:
    """Return the parts of the motion in which a model leaves something significant, the largest first."""
    detection = diagnostics.detection
    places = [
        Place(g.where, g.against, s.improvement / max(s.dof, 1), a)
        for g, s, a in zip(diagnostics.groups, detection.groups, detection.adjusted)
        if a < DETECTION.place_level
    ]
    return sorted(places, key=lambda p: -p.score)


def stages(null: Hypothesis, fitted: Sequence[Hypothesis]) -> tuple[Place, ...]:
    """Return the stages of the model whose effects close most of the gap when they are fitted, best first.

    What an effect would gain in the screen says little where the gap is large: much that has nothing to do
    with it absorbs some of it. Effects of several stages together tell of these only as the best set.
    """

    def closed(h: Hypothesis) -> float:
        return (null.fit.misfit_ratio - h.fit.misfit_ratio) / max(null.fit.misfit_ratio - 1, 1e-9)

    found: dict[str, Place] = {}
    ordered = sorted(
        (h for h in fitted if h.candidates and closed(h) >= EXPLANATION.stage_share), key=closed, reverse=True
    )
    for h in ordered:
        alone = len({c.form.effect.kind for c in h.candidates}) == 1
        for c in h.candidates if alone or h is ordered[0] else ():
            where = STAGES[c.form.effect.kind]
            if c.place is not None and c.form.effect.place is not None:
                where += f", {c.form.effect.place.name} {c.place}"
            gain = (null.deviance - h.deviance) / h.parameters
            # ordered by what they close: the first of a kind is its best
            found.setdefault(c.form.effect.kind, Place(where, c.form.effect.what, gain, 0.0))
    return tuple(found.values())


def misfit_by_trial(diagnostics: Diagnostics) -> dict[str, float]:
    """Return every trial's misfit over its expectation under noise."""
    return {n: g.misfit / max(g.count, 1) for n, g in diagnostics.linearisation.equations.items()}


__all__ = ["Place", "locate", "misfit_by_trial", "stages", "sum_eliminated"]

"""Step 4: where the model and the data part, and against what; reported even when no name follows."""

from __future__ import annotations

from dataclasses import dataclass

from srs_opt.calibrate.objective import sum_eliminated
from srs_opt.discrepancy.examined import Examined

ODD = 3.0
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


def locate(examined: Examined, most: int = 8) -> tuple[Place, ...]:
    """Return where the gap shows most, best first: parts of the motion, then stages by their best effect."""
    return (*stages(examined), *left_places(examined)[:most])


def left_places(examined: Examined) -> list[Place]:
    """Return the parts of the motion in which a model leaves something significant, the largest first."""
    detection = examined.detection
    places = [
        Place(g.where, g.against, s.improvement / max(s.dof, 1), a)
        for g, s, a in zip(examined.groups, detection.groups, detection.adjusted)
        if a < 0.05
    ]
    return sorted(places, key=lambda p: -p.score)


def stages(examined: Examined) -> tuple[Place, ...]:
    """Return the stages of the model, scored by the best effect that each could lack."""
    from srs_opt.model.effects import known_effects

    best: dict[str, tuple[float, int]] = {}
    temper = examined.linearisation.temper
    for score in examined.scores:
        kind = known_effects()[score.candidate.effect].kind
        gain = score.improvement * temper
        if gain > best.get(kind, (0.0, 1))[0]:
            best[kind] = (gain, score.dof)
    found = [
        Place(STAGES[kind], "any effect of this stage", gain / dof, 0.0) for kind, (gain, dof) in best.items()
    ]
    return tuple(sorted((p for p in found if p.score > 20), key=lambda p: -p.score))


def misfit_by_trial(examined: Examined) -> dict[str, float]:
    """Return every trial's misfit over its expectation under noise."""
    return {n: g.misfit / max(g.count, 1) for n, g in examined.linearisation.grams.items()}


def odd_trials(examined: Examined) -> tuple[str, ...]:
    """Return the few trials whose misfit is several times that of most, worst first."""
    misfit = {n: m for n, m in misfit_by_trial(examined).items() if examined.linearisation.grams[n].scattered}
    usual = sorted(misfit.values())[len(misfit) // 2]
    odd = sorted((n for n, m in misfit.items() if m > ODD * usual and m > 1.2), key=lambda n: -misfit[n])
    return tuple(odd) if len(odd) <= len(misfit) // 4 else ()


__all__ = ["Place", "locate", "misfit_by_trial", "odd_trials", "stages", "sum_eliminated"]

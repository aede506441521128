"""How large a missing effect the data would have shown, for those that show none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from srs_opt.calibrate.candidates import Candidate
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.noise import track_of
from srs_opt.calibrate.objective import priors, projected, sum_eliminated
from srs_opt.discrepancy.diagnostics import Diagnostics, needed_gain
from srs_opt.discrepancy.gap_settings import PLAUSIBILITY, VISIBLE
from srs_opt.discrepancy.motions import motion_errors
from srs_opt.discrepancy.settings import ADEQUACY, AdequacySettings
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Trial


@dataclass(frozen=True)
class Visible:
    """The smallest missing effect that would have been found nine times in ten, whatever it is.

    Attributes
    ----------
    m : float
        Root mean square by which it moves the markers, as gaps are measured: after calibration and the
        trials' own friction and curvature have made up for what they can.
    speed_share, radius_share : float or None
        Changes of speed and radius over themselves; None where no trial drives.
    not_seen : tuple of str
        Effects that these data do not show at any plausible size.
    """

    m: float
    speed_share: float | None
    radius_share: float | None
    not_seen: tuple[str, ...] = field(default=())

    @property
    def in_words(self) -> str:
        """What may be said of what was not found."""
        said = f"moves the markers by more than {1e3 * self.m:.2g} mm beyond what calibration makes up for"
        if self.speed_share is not None:
            said += f", or changes the speed by more than {self.speed_share:.1%}"
        said = f"any known effect that {said} would have been seen"
        return f"{said}, except {', '.join(self.not_seen)}" if self.not_seen else said


def visible(
    experiment: Experiment,
    null: Diagnostics,
    candidates: Sequence[Candidate],
    trials: Sequence[Trial],
    settings: AdequacySettings = ADEQUACY,
) -> Visible:
    """Return the smallest missing effect that the open trials would have shown.

    For speed and radius every effect is played on a few of `trials`, at the size at which it would have been
    found and the place where it shows least, with the calibrated parameters gone where the fit would take
    them.
    """
    lin = null.linearisation
    total = sum_eliminated(lin.telling, lin.variance_inflation)
    precision, _ = priors(lin.coordinates, lin.point)
    inverse, left = projected(total, lin.fitted, precision)
    free = {c.name: k for k, c in enumerate(lin.coordinates[lin.fitted :])}
    played = _spread([t for t in trials if t.kind == "gait"] or trials)
    sizes, unseen = {}, []
    for effect in dict.fromkeys(c.effect for c in candidates):
        places = [c for c in candidates if c.effect == effect]
        columns = [(free[c.sizes[0].name], c) for c in places if c.sizes[0].name in free]
        found = [
            (_least(left[k, k], total[lin.fitted + k, lin.fitted + k], c, len(null.scores)), c)
            for k, c in columns
        ]
        seen = [(s, c) for s, c in found if s <= PLAUSIBILITY.most_size * c.sizes[0].typical]
        if found and not seen:
            unseen.append(effect)
        if seen:
            sizes[effect] = max(seen, key=lambda pair: pair[0] / pair[1].sizes[0].typical)
    point = null.hypothesis.fit.point
    count = sum(g.count for g in lin.telling.values())
    needed = max(_needed(c, len(null.scores)) for c in candidates) if candidates else 0.0
    seen_m = max(
        needed * experiment.sd_m * float(np.sqrt(lin.variance_inflation / count)), settings.negligible_m
    )
    if not played:
        return Visible(seen_m, None, None, tuple(unseen))
    before = experiment.residuals(played, Point(point.values))
    tracks = [np.asarray(track_of(t)) for t in played]
    figures = []
    for size, candidate in sizes.values():
        column = lin.column(candidate.sizes[0].name)
        # where the fit would go to make up for the effect: least squares of -size times its column
        follow = -size * (inverse @ total[: lin.fitted, column])
        values = dict(point.values)
        for c, step in zip(lin.coordinates, follow):
            values[c.name] = max(values.get(c.name, 0.0) + float(step), c.lower)
        values[candidate.sizes[0].name] = size
        values |= {c.name: c.start for c in candidate.scales}
        try:
            after = experiment.residuals(played, Point(values))
        except NoAnswerError:
            continue
        moved = [b - a for a, b in zip(after, before)]
        as_if = [t - b for t, b in zip(tracks, before)]
        figures.append(motion_errors(played, moved, experiment.model.robot.length_m, as_if))
    speed, radius = (_largest([f[k] for f in figures], settings.negligible_speed) for k in (0, 1))
    return Visible(seen_m, speed, radius, tuple(unseen))


def _largest(values: Sequence[float | None], floor: float) -> float | None:
    """Return the largest; no less than what is taken for no gap at all."""
    known = [v for v in values if v is not None]
    return max([*known, floor]) if known else None


def _needed(candidate: Candidate, family: int) -> float:
    """Return the deviations from zero at which an effect is found nine times in ten."""
    return float(np.sqrt(needed_gain(candidate, family))) + VISIBLE.detected_sd


def _least(information: float, whole: float, candidate: Candidate, family: int) -> float:
    """Return the size at which an effect is found nine times in ten.

    `information` is what of the `whole` is left when the fitted have followed.
    """
    if information <= 1e-9 * whole:
        return float("inf")
    # the estimate's deviation is information^(-1/2); the effect is found when it is so many of them off zero
    return _needed(candidate, family) / float(np.sqrt(information))


def _spread(trials: Sequence[Trial]) -> list[Trial]:
    """Return a few trials, straight and turning."""
    ordered = sorted(trials, key=lambda t: (t.offset, t.name))
    count = min(VISIBLE.trials, len(ordered))
    return [ordered[round(k * (len(ordered) - 1) / max(count - 1, 1))] for k in range(count)]

"""Where a fit of a body that bends under load begins: soft already, at the bench's values.

Such a body moves otherwise before it is as soft as the real one. What calibration made of that (half the
friction) hides it from derivatives about a rigid body, and from far off a fit diverges; so some
stiffnesses are played, and the best one is where to begin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from srs_opt.calibrate.candidates import Candidate
from srs_opt.calibrate.coordinates import SCATTER_SD, Coordinate
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit import start_point
from srs_opt.discrepancy.hypothesis import Hypothesis
from srs_opt.discrepancy.search_settings import SCREEN
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Trial


def soft_start(
    experiment: Experiment,
    base: Sequence[Coordinate],
    candidate: Candidate,
    beside: Hypothesis,
    trials: Sequence[Trial],
) -> Point:
    """Return the point from which to fit `candidate`, a bending body, beside the effects of a hypothesis."""
    fit = beside.fit
    effects = {c.name: fit.point.values[c.name] for c in fit.coordinates if c.effect}
    values = {**start_point((*base, *candidate.coordinates)).values, **effects}
    size, *_ = candidate.sizes
    # the scatter's derivatives alone are taken, for a third of the time
    few = [c for c in base if c.name in SCATTER_SD] or base[:1]

    def misfit(point: Point) -> float:
        try:
            equations = experiment.normal_equations(point, few, trials, rough=True)
        except NoAnswerError:
            return math.inf
        return sum(normal.misfit for normal in equations.values())

    return min(
        (Point({**values, size.name: leap * size.typical}) for leap in SCREEN.soft_start_sizes), key=misfit
    )

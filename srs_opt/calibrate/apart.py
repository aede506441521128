"""Outlying trials (a wrong entry, another robot), found by leaving them out of the fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from srs_opt.calibrate.coordinates import SCATTER_SD, Coordinate
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit import Fit
from srs_opt.calibrate.objective import CORRELATED
from srs_opt.measurement.records import Trial

LEAST_LEFT = 3  # trials that must agree with each other
# Misfit beyond the noise of a trial that a fit did not see, over that of the worst trial that it saw, from
# which on the trial is set aside. What a model lacks shows in several trials: a gait that the others do not
# foretell is three times worse than they are; a wrong entry or another robot, twenty times and more.
APART = 8.0
NOTABLE = 0.5  # of the noise's variance: misfit that is worth a refit
WORST = 3.0  # times the usual misfit that a trial must have in the fit to all, to be left out on trial
Refit = Callable[[Sequence[str]], Fit | None]


def own_scatter(experiment: Experiment, fit: Fit, trials: Sequence[Trial]) -> Point:
    """Return a fit's point with the most probable scatter of trials that it did not see."""
    own = _own(fit)
    point = Point(fit.point.values, {})
    for _ in range(3):
        equations = experiment.normal_equations(point, own, trials)
        moved, settled = {}, True
        for trial in trials:
            normal = equations[trial.name]
            excess = normal.misfit / normal.count - 1 - 4 * np.sqrt(2 / normal.count)
            back = normal.eliminated(1 + CORRELATED * max(0.0, excess)).back
            now = point.scatter.get(trial.name, np.zeros(back.shape[0]))
            moved[trial.name] = np.clip(now + back[:, -1], -4 * normal.scatter_sd, 4 * normal.scatter_sd)
            settled &= bool(np.abs(moved[trial.name] - now).max() < 0.05 * normal.scatter_sd.min())
        if settled:
            break
        point = Point(fit.point.values, moved)
    return point


def stands_apart(
    experiment: Experiment, fit: Fit, trials: Sequence[Trial], refit: Refit
) -> tuple[dict[str, str], Fit]:
    """Return the few trials, if any, that contradict all others, and the fit to these.

    Each stands with what speaks against it.

    Parameters
    ----------
    fit : Fit
        To all of `trials`.
    refit : callable
        Names of trials -> the fit to the others, None where there is none.
    """
    aside: dict[str, str] = {}
    for _ in range(max(1, len(trials) // 4)):
        rest = [t for t in trials if t.name not in aside]
        misfit = {
            t.name: fit.equations[t.name].misfit / max(fit.equations[t.name].count, 1) - 1 for t in rest
        }
        worst = max(rest, key=lambda t: misfit[t.name])
        usual = float(np.median(list(misfit.values())))
        if len(rest) <= LEAST_LEFT or misfit[worst.name] < max(NOTABLE, WORST * usual):
            break
        without = refit([*aside, worst.name])
        if without is None:
            break
        others = [g for n, g in without.equations.items() if n != worst.name and g.scattered]
        known = max(max(g.misfit / max(g.count, 1) - 1 for g in others), NOTABLE / APART)
        normal = experiment.normal_equations(
            own_scatter(experiment, without, [worst]), _own(without), [worst]
        )[worst.name]
        off = normal.misfit / max(normal.count, 1) - 1
        if off < APART * known:
            break
        miss, most = (1e3 * experiment.sd_m * np.sqrt(v) for v in (off, known))
        aside[worst.name] = (
            f"contradicts the others: a fit without it misses it by {miss:.3g} mm, none of them by more than "
            f"{most:.3g} mm; look at its entry in the notebook, and at the robot"
        )
        fit = without
    return aside, fit


def _own(fit: Fit) -> list[Coordinate]:
    """Return the coordinates about which trials scatter."""
    return [c for c in fit.coordinates if c.name in SCATTER_SD]

"""Outlying trials (a wrong entry, another robot), found by leaving them out of the fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from srs_opt.calibrate.coordinates import SCATTER_SD, Coordinate
from srs_opt.calibrate.data_settings import OUTLYING_TRIAL
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit import Fit
from srs_opt.calibrate.fit_settings import OBJECTIVE
from srs_opt.measurement.records import Trial

Refit = Callable[[Sequence[str]], Fit | None]


def own_scatter(experiment: Experiment, fit: Fit, trials: Sequence[Trial]) -> Point:
    """Return a fit's point with the most probable scatter of trials that it did not see."""
    own = _own(fit)
    point = Point(fit.point.values, {})
    for _ in range(OUTLYING_TRIAL.scatter_rounds):
        equations = experiment.normal_equations(point, own, trials)
        moved, settled = {}, True
        for trial in trials:
            normal = equations[trial.name]
            # the trial's own variance inflation, as in `variance_inflation_of`
            excess = normal.misfit / normal.count - 1 - OBJECTIVE.inflation_sd * np.sqrt(2 / normal.count)
            back = normal.eliminated(1 + OBJECTIVE.correlated_values * max(0.0, excess)).back
            now = point.scatter.get(trial.name, np.zeros(back.shape[0]))
            limit = OUTLYING_TRIAL.most_scatter_sd * normal.scatter_sd
            moved[trial.name] = np.clip(now + back[:, -1], -limit, limit)
            moves = np.abs(moved[trial.name] - now).max()
            settled &= bool(moves < OUTLYING_TRIAL.settled_sd * normal.scatter_sd.min())
        if settled:
            break
        point = Point(fit.point.values, moved)
    return point


def outlying_trials(
    experiment: Experiment, fit: Fit, trials: Sequence[Trial], refit: Refit
) -> tuple[dict[str, str], Fit]:
    """Return the few trials, if any, that contradict all others, and the fit to these.

    With each stands what it contradicts.

    Parameters
    ----------
    fit : Fit
        To all of `trials`.
    refit : callable
        Names of trials -> the fit to the others, None where there is none.
    """
    aside: dict[str, str] = {}
    for _ in range(max(1, int(OUTLYING_TRIAL.most_share * len(trials)))):
        rest = [t for t in trials if t.name not in aside]
        misfit = {
            t.name: fit.equations[t.name].misfit / max(fit.equations[t.name].count, 1) - 1 for t in rest
        }
        worst = max(rest, key=lambda t: misfit[t.name])
        usual = float(np.median(list(misfit.values())))
        suspicious = max(OUTLYING_TRIAL.notable_misfit, OUTLYING_TRIAL.worst_ratio * usual)
        if len(rest) <= OUTLYING_TRIAL.least_left or misfit[worst.name] < suspicious:
            break
        without = refit([*aside, worst.name])
        if without is None:
            break
        others = [g for n, g in without.equations.items() if n != worst.name and g.scattered]
        known = max(
            max(g.misfit / max(g.count, 1) - 1 for g in others),
            OUTLYING_TRIAL.notable_misfit / OUTLYING_TRIAL.apart_ratio,
        )
        # with its own best scatter: a friction of its own is no contradiction
        normal = experiment.normal_equations(
            own_scatter(experiment, without, [worst]), _own(without), [worst]
        )[worst.name]
        off = normal.misfit / max(normal.count, 1) - 1
        if off < OUTLYING_TRIAL.apart_ratio * known:
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

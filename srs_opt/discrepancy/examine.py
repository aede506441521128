"""Linearise about a fitted hypothesis, test what is left and screen what could explain it.

What every candidate does is by far the costliest part, and a few trials tell as well what is worth a refit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from srs_opt.calibrate.candidates import Candidate
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit_settings import FIT
from srs_opt.calibrate.normal_equations import NormalEquations
from srs_opt.calibrate.objective import priors, sum_eliminated
from srs_opt.discrepancy.detect import detect, project, with_shared
from srs_opt.discrepancy.diagnostics import Diagnostics
from srs_opt.discrepancy.functions import ResidualFunctions
from srs_opt.discrepancy.hypothesis import Hypothesis
from srs_opt.discrepancy.screen import Linearisation, screen
from srs_opt.discrepancy.search_settings import SCREEN
from srs_opt.discrepancy.split import brief_name
from srs_opt.measurement.records import Trial


def screened_of(trials: Sequence[Trial], quick: Sequence[Trial]) -> tuple[Trial, ...]:
    """Return the trials on which candidates are screened: all, or where that takes long those of `quick`."""
    few = {t.name for t in quick}
    chosen = tuple(t for t in trials if brief_name(t.name) in few)
    long = sum(float(t.time_s[-1] - t.time_s[0]) for t in trials) > SCREEN.screened_s
    return chosen if long and chosen else tuple(trials)


def linearised(
    experiment: Experiment,
    hypothesis: Hypothesis,
    candidates: Sequence[Candidate],
    trials: Sequence[Trial],
    screened: Sequence[Trial],
    functions: ResidualFunctions,
    *,
    stale: bool,
) -> Linearisation:
    """Return normal equations by what is fitted, the sizes of all candidates and residual functions.

    In trials that are not among `screened` candidates do nothing: their tests are as exact, and less sharp.
    """
    fit = hypothesis.fit
    names = {c.name for c in fit.coordinates}
    others = [c for k in candidates for c in k.sizes if c.name not in names]
    coordinates = (*fit.coordinates, *others)
    point = Point({**{c.name: 0.0 for c in others}, **fit.point.values}, fit.point.scatter)
    rough = fit.variance_inflation > FIT.rough_inflation
    rest = [t for t in trials if t not in screened]
    found: dict[str, NormalEquations] = {}
    if rest:
        plain = experiment.normal_equations(
            fit.point, fit.coordinates, rest, functions, rough=rough, stale=stale
        )
        found = {n: _widened(g, len(fit.coordinates), len(others)) for n, g in plain.items()}
    if experiment.keeps and not (
        rough or stale
    ):  # what candidates do need not be known as well as the motion
        experiment.normal_equations(point, coordinates, screened, functions, rough=True)
        stale = True
    wide = experiment.normal_equations(point, coordinates, screened, functions, rough=rough, stale=stale)
    whole = found | wide
    # in the trials' order: sums over them then have the same bits however they were asked for
    ordered = {t.name: whole.pop(t.name) for t in trials} | whole
    return Linearisation(
        coordinates, len(fit.coordinates), point, ordered, fit.variance_inflation, frozenset(wide)
    )


def examined(
    lin: Linearisation,
    hypothesis: Hypothesis,
    candidates: Sequence[Candidate],
    functions: ResidualFunctions,
    shared_sd: np.ndarray,
    seed: int,
) -> Diagnostics:
    """Return a hypothesis with its tests.

    Parameters
    ----------
    shared_sd : array
        By how much errors that repeat with the gait move every residual function alike in all trials.
    """
    groups = functions.groups()
    size, columns = len(lin.coordinates), next(iter(lin.equations.values())).raw.shape[0] - 1
    total = sum_eliminated(lin.equations, 1.0)
    precision, offset = priors(lin.coordinates[: lin.fitted], lin.point)
    score, covariance = project(total, range(lin.fitted), range(lin.fitted, columns), precision, offset)
    covariance = with_shared(covariance, np.append(np.zeros(size - lin.fitted), shared_sd))
    further = [[lin.column(c.name) - lin.fitted for c in k.sizes] for k in candidates]
    # effects that are fitted already have no further column
    tested = [g for g in further if min(g) >= 0]
    start = size - lin.fitted
    families = [[start + k for k in g.columns] for g in groups] + tested
    serial = np.array([g.serial for g in lin.equations.values() if g.scattered])
    # a stream of its own: the draws do not depend on what else is drawn from the seed
    detection = detect(score, covariance, families, serial, np.random.default_rng([seed, 17]))
    return Diagnostics(hypothesis, lin, detection, groups, tuple(screen(lin, candidates)))


def _widened(normal: NormalEquations, first: int, count: int) -> NormalEquations:
    """Return the equations with `count` columns of zeros from column `first` on."""
    # zeros in rows and columns: these trials say nothing of the candidates
    raw = np.insert(normal.raw, [first] * count, 0.0, axis=0)
    return replace(normal, raw=np.insert(raw, [first] * count, 0.0, axis=1))

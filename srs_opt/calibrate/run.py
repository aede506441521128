"""Calibrate a robot against a data set."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from srs_opt.calibrate.candidates import fitted_coordinates
from srs_opt.calibrate.clean import cleaned
from srs_opt.calibrate.colour import coloured
from srs_opt.calibrate.experiment import Experiment
from srs_opt.calibrate.fit import Fit, fit, start_point
from srs_opt.calibrate.fit_settings import FIT
from srs_opt.calibrate.maps import fit_maps
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.noise import Noise, noise_of
from srs_opt.calibrate.outlying_trials import outlying_trials
from srs_opt.calibrate.result import Calibration, calibration
from srs_opt.calibrate.smooth import DRIFTS, unit_terms
from srs_opt.calibrate.smooth_variance import Amplitudes, smooth_part
from srs_opt.errors import InputError
from srs_opt.measurement.records import DataSet, Trial
from srs_opt.parallel import HERE, Executor
from srs_opt.robot import Robot


def calibrate(
    dataset: DataSet,
    model: str | None = None,
    report: Callable[[str], None] | None = None,
    where: Executor = HERE,
) -> Calibration:
    """Fit the robot's parameters to all usable trials, or to the maps where there are no tracks.

    `where` says who simulates the trials (`srs_opt.parallel.executor`); the answer is the same.

    Raises
    ------
    InputError
        If the set holds nothing to calibrate on.
    NoAnswerError
        If the robot cannot be simulated under the trials' conditions.
    """
    from srs_opt.calibrate.rejection import left_out

    tell = report or (lambda message: None)
    dataset = _cleaned(dataset, tell)
    aside = left_out(dataset.trials)
    for name, why in aside.items():
        tell(f"trial {name} left out: {why}")
    trials = [t for t in dataset.trials if t.name not in aside]
    if not trials:
        if not dataset.maps:
            raise InputError(f"data set '{dataset.name}': no usable trial and no map to calibrate on")
        return fit_maps(dataset, model, tell)
    for t in trials:
        expected = dataset.robot.links if t.spots is None else len(t.spots)
        if t.markers_m is not None and t.markers_m.shape[1] != expected:
            raise InputError(
                f"trial {t.name} has {t.markers_m.shape[1]} markers, "
                f"robot '{dataset.robot.name}' and the set's markers make {expected}"
            )
    base = fitted_coordinates(dataset.robot)
    experiment = Experiment(Model(dataset.robot, model), trials, noise_of(dataset), dataset.bench, where)
    found = fit(experiment, base, start_point(base), report=tell)
    noise = _noise_left(experiment, found, trials)
    if noise != experiment.noise:
        tell(f"noise: {noise.in_words}")
        experiment = experiment.with_noise(noise)
        start_ratio = found.start_misfit_ratio
        # from where the first fit ended, but reported against where that one began
        found = replace(fit(experiment, base, found.point, report=tell), start_misfit_ratio=start_ratio)
    before = math.sqrt(found.start_misfit_ratio)
    experiment, found, odd = _without_odd(experiment, found)
    for name, why in odd.items():
        tell(f"trial {name} left out: {why}")
    result = calibration(dataset.robot, found, before, math.sqrt(found.misfit_ratio), experiment.noise)
    return replace(result, set_aside=aside | odd)


def _without_odd(experiment: Experiment, found: Fit) -> tuple[Experiment, Fit, dict[str, str]]:
    """Return the fit to the trials that do not contradict all others, and those that do."""

    coordinates = found.coordinates

    def refit(names: Sequence[str]) -> Fit:
        rest = [t for t in experiment.trials if t.name not in names]
        # from the bench's values: what the fit to all found is bent by the very trial that is left out
        return fit(experiment, coordinates, None, rest, FIT.refit_iterations)

    odd, found = outlying_trials(experiment, found, experiment.trials, refit)
    if not odd:
        return experiment, found, odd
    rest = [t for t in experiment.trials if t.name not in odd]
    noise = _noise_left(experiment, found, rest)
    if noise != experiment.noise:
        experiment = experiment.with_noise(noise)
        found = fit(experiment, found.coordinates, found.point, rest)
    return experiment, found, odd


def _cleaned(dataset: DataSet, tell: Callable[[str], None]) -> DataSet:
    """Return the data set without outliers and with labels in order."""
    found = cleaned(dataset)
    if found.outliers:
        tell(f"{sum(found.outliers.values())} positions left out as outliers")
    if found.swapped:
        tell(f"swapped labels corrected in trials {', '.join(found.swapped)}")
    return found.dataset


def _noise_left(experiment: Experiment, found: Fit, trials: Sequence[Trial]) -> Noise:
    """Return the noise that a fit's residuals show, smooth errors only if they explain all that is left."""
    first = len(found.coordinates)
    noise = coloured(experiment.noise, trials, experiment.residuals(trials, found.point))
    equations = experiment.with_noise(noise).normal_equations(
        found.point, found.coordinates, trials, unit_terms
    )
    columns = range(first, next(iter(equations.values())).raw.shape[0] - 1)
    units = [dict.fromkeys(some, 1.0) for some in (columns[:DRIFTS], columns[DRIFTS:])]
    amplitudes = {t.name: Amplitudes(*units) for t in trials}
    return smooth_part(noise, equations, amplitudes, found.coordinates, found.point)


def going_on_from(dataset: DataSet, robot: Robot) -> DataSet:
    """Return the data set with another robot file's values and effects as the starting point.

    Values that were calibrated may come from these very data, which must not count twice: for them the data
    set's own bench values and deviations stay. Effects of an earlier answer are refitted where they have a
    deviation.

    Raises
    ------
    InputError
        If the robots have different numbers of links.
    """
    own = dataset.robot
    if robot.links != own.links:
        raise InputError(
            f"robot '{robot.name}' has {robot.links} links, that of data set '{dataset.name}' has {own.links}"
        )
    names = [name for name, source in robot.sources.items() if source == "calibrated"]
    deviations = {n: sd for n, sd in robot.relative_sd.items() if n not in names}
    sources = {n: s for n, s in robot.sources.items() if n not in names}
    changed = robot.with_values(
        **{n: getattr(own, n) for n in names},
        relative_sd={**deviations, **{n: own.relative_sd[n] for n in names if n in own.relative_sd}},
        sources={**sources, **{n: own.sources[n] for n in names if n in own.sources}},
    )
    return replace(dataset, robot=changed)

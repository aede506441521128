"""Calibrate a robot against a data set."""

from __future__ import annotations

import math
from collections.abc import Callable

from srs_opt.calibrate.coordinates import base_coordinates
from srs_opt.calibrate.crew import helped
from srs_opt.calibrate.experiment import Experiment
from srs_opt.calibrate.fit import fit, start_point
from srs_opt.calibrate.maps import fit_maps
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.noise import noise_sd_m
from srs_opt.calibrate.result import Calibration, calibration
from srs_opt.errors import InputError
from srs_opt.measurement.records import DataSet


def calibrate(
    dataset: DataSet,
    model: str = "complex",
    report: Callable[[str], None] | None = None,
    jobs: int = 1,
    cluster: str | None = None,
) -> Calibration:
    """Fit the robot's parameters to all usable trials, or to the maps where there are no tracks.

    `jobs` processes, or a Dask cluster (address of its scheduler), share the trials; same answer.

    Raises
    ------
    InputError
        If the set holds nothing to calibrate on.
    NoAnswerError
        If the robot cannot be simulated under the trials' conditions.
    """
    from srs_opt.calibrate.usable import usable

    tell = report or (lambda message: None)
    trials = [t for t in dataset.trials if not usable(t)]
    for t in dataset.trials:
        if usable(t):
            tell(f"trial {t.name} left out: {usable(t)}")
    if not trials:
        if not dataset.maps:
            raise InputError(f"data set '{dataset.name}': no usable trial and no map to calibrate on")
        return fit_maps(dataset, model, tell)
    for t in trials:
        if t.markers_m is not None and t.markers_m.shape[1] != dataset.robot.links:
            raise InputError(
                f"trial {t.name} has {t.markers_m.shape[1]} markers, robot '{dataset.robot.name}' has "
                f"{dataset.robot.links} links"
            )
    base = base_coordinates(dataset.robot)
    experiment = Experiment(Model(dataset.robot, model), trials, noise_sd_m(dataset), dataset.bench)
    with helped(experiment, jobs, cluster):
        found = fit(experiment, base, start_point(base), report=tell)
    before, after = math.sqrt(found.start_misfit_ratio), math.sqrt(found.misfit_ratio)
    return calibration(dataset.robot, found, before, after)

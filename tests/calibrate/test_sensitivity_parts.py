"""The pieces behind the slopes: the chained recurrence, the small structure, the tolerance."""

import numpy as np
import pytest

from srs_opt.calibrate.coordinates import all_candidates, base_coordinates
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit import start_point
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.nominal import FINEST_M_S, TOLERANCE_M_S, conditions_of, tolerance_for
from srs_opt.calibrate.sensitivity import _solve, variation
from srs_opt.measurement.records import Trial
from srs_opt.robot import wpi_srs


@pytest.mark.parametrize("n", [1, 2, 7, 49, 50, 101])
def test_chained_runs_are_the_plain_recurrence(n):
    rng = np.random.default_rng(n)
    decay, forcing = 0.4 * rng.standard_normal((n, 2, 3, 3)), rng.standard_normal((n, 2, 3, 5))
    start = rng.standard_normal((2, 3, 5))
    plain = [start]
    for k in range(n):
        plain.append(decay[k] @ (plain[-1] + forcing[k]))
    assert _solve(decay, forcing, start) == pytest.approx(np.array(plain), rel=1e-12, abs=1e-12)


@pytest.fixture(scope="module")
def setting():
    robot = wpi_srs()
    time_s = np.arange(60) / 100
    blank = np.zeros((time_s.size, robot.links, 2))
    trial = Trial("t", 2.0, 48.0, 0.4, np.pi / 2, 0.7, 0.6, time_s, markers_m=blank)
    base = base_coordinates(robot)
    return Experiment(Model(robot), [trial], 0.001), trial, base, start_point(base)


def test_the_small_structure_gives_the_slopes_of_the_full_one(setting):
    experiment, trial, base, start = setting
    model = experiment.model
    effects = tuple(c for k in all_candidates(model.links) for c in k.sizes)
    nodes = experiment.runs["t"](start.values)
    seeds = model.seeds(start.values, conditions_of(trial), base)
    found = []
    for coordinates in (base, (*base, *effects)):
        structure, kept = model.structure(start.values, coordinates)
        found.append(variation(structure, nodes, nodes.p[kept], seeds[kept], trial.heading_rad, 4.0))
    assert structure == model.full
    assert found[0].pose == pytest.approx(found[1].pose, rel=1e-9, abs=1e-11)
    assert found[0].kappa == pytest.approx(found[1].kappa, rel=1e-9, abs=1e-9)


def test_slopes_of_a_calibration_are_exact(setting):
    experiment, trial, base, start = setting
    fine, h = 1e-7, 1e-4
    slopes = experiment.predict(trial, start, base, fine).slopes
    for k, coordinate in enumerate(base):
        ends = []
        for sign in (1, -1):
            moved = {**start.values, coordinate.name: start.values[coordinate.name] + sign * h}
            ends.append(experiment.predict(trial, Point(moved), (), fine).points)
        difference = (ends[0] - ends[1]) / (2 * h)
        assert np.abs(slopes[:, :, k] - difference).max() < 1e-3 * np.abs(difference).max(), coordinate.name


def test_more_data_ask_for_a_finer_simulation():
    assert tolerance_for(1000, 0.001) == TOLERANCE_M_S
    assert tolerance_for(60_000, 0.001) == pytest.approx(TOLERANCE_M_S / 2)
    assert tolerance_for(60_000, 0.0005) == pytest.approx(TOLERANCE_M_S / 4)
    assert tolerance_for(10**9, 1e-6) == FINEST_M_S

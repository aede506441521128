"""The pieces behind the slopes: the chained recurrence, the small structure, the tolerance."""

import numpy as np
import pytest

from srs_opt.calibrate.coordinates import all_candidates, base_coordinates
from srs_opt.calibrate.fit import Experiment, start_point
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.nominal import FINEST_M_S, TOLERANCE_M_S, tolerance_for
from srs_opt.calibrate.sensitivity import _solve
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


def test_the_small_structure_gives_the_slopes_of_the_full_one():
    robot = wpi_srs()
    time_s = np.arange(60) / 100
    blank = np.zeros((time_s.size, robot.links, 2))
    trial = Trial("t", 2.0, 48.0, 0.4, np.pi / 2, 0.7, 0.6, time_s, markers_m=blank)
    model = Model(robot)
    experiment = Experiment(model, [trial], 0.001)
    base = base_coordinates(robot)
    effects = tuple(c for k in all_candidates(robot.links) for c in k.sizes)
    start = start_point(base)
    assert model.structure(start.values, base)[0] == model.structures[0]
    assert model.structure(start.values, (*base, *effects))[0] == model.full
    alone = experiment.predict(trial, start, base).slopes
    among = experiment.predict(trial, start, (*base, *effects)).slopes[:, :, : len(base)]
    assert alone == pytest.approx(among, rel=1e-9, abs=1e-11)


def test_more_data_ask_for_a_finer_simulation():
    assert tolerance_for(1000, 0.001) == TOLERANCE_M_S
    assert tolerance_for(60_000, 0.001) == pytest.approx(TOLERANCE_M_S / 2)
    assert tolerance_for(60_000, 0.0005) == pytest.approx(TOLERANCE_M_S / 4)
    assert tolerance_for(10**9, 1e-6) == FINEST_M_S

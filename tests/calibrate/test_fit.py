"""The fit's own promises, on a model of two coordinates whose valley is curved."""

import numpy as np
import pytest

from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.experiment import Point
from srs_opt.calibrate.fit import CONVERGED, fit
from srs_opt.calibrate.gram import trial_gram
from srs_opt.calibrate.objective import objective, within_reach

TRUTH = np.array([0.4, 1.2])
COORDINATES = (Coordinate("size.of_it", "size"), Coordinate("width.of_it", "width"))


class Curved:
    """Many values of a smooth function in which size and width nearly make up for each other."""

    trials = ()

    def __init__(self, count, wrong=0.0):
        rng = np.random.default_rng(1)
        self.t = np.linspace(0, 1, count)
        clean = self.values(TRUTH) + wrong * np.sin(9 * self.t)
        self.measured = clean + 0.01 * rng.standard_normal(count)
        self.slopes = None

    def values(self, x):
        return x[0] * np.exp(x[1] * (1 + 0.2 * self.t))

    def grams(self, point, coordinates, trials=None, *, stale=False):
        x = np.array([point.values[c.name] for c in coordinates])
        if not stale:
            steps = 1e-6 * np.eye(2)
            ends = [(self.values(x + s) - self.values(x - s)) / 2e-6 for s in steps]
            self.slopes = np.column_stack(ends)
        none = np.zeros(0)
        return {"all": trial_gram(self.measured - self.values(x), self.slopes, 0.01, (), none, none)}


@pytest.mark.parametrize("count", [100, 100_000])
@pytest.mark.parametrize("wrong", [0.0, 0.001])
def test_a_converged_fit_has_nothing_left_to_gain_however_many_data(count, wrong):
    measured = Curved(count, wrong)
    found = fit(measured, COORDINATES, Point({"size.of_it": 0.8, "width.of_it": 0.5}), iterations=100)
    assert found.converged
    assert found.temper == 1
    grams = measured.grams(found.point, COORDINATES)
    now = objective(COORDINATES, grams, found.point, 1.0)
    assert now - within_reach(COORDINATES, grams, found.point) < CONVERGED
    if not wrong:
        off = [found.point.values[c.name] - v for c, v in zip(COORDINATES, TRUTH)]
        assert np.all(np.abs(off) < 4 * np.array(list(found.sd.values())))


def test_a_fit_that_was_cut_short_says_so():
    found = fit(Curved(1000), COORDINATES, Point({"size.of_it": 3.0, "width.of_it": -1.0}), iterations=1)
    assert not found.converged

"""The fit's own promises, on a model of two coordinates whose valley is curved."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize

from srs_opt.calibrate.coordinates import Coordinate
from srs_opt.calibrate.experiment import Point
from srs_opt.calibrate.fit import fit
from srs_opt.calibrate.fit_settings import FIT, OBJECTIVE
from srs_opt.calibrate.normal_equations import trial_normal_equations
from srs_opt.calibrate.objective import best_move, geodesic_move, objective, within_reach
from srs_opt.calibrate.result import unidentifiable
from srs_opt.calibrate.whiten import Whitening

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
        self.jacobian = None

    def values(self, x):
        return x[0] * np.exp(x[1] * (1 + 0.2 * self.t))

    def normal_equations(self, point, coordinates, trials=None, *, stale=False, rough=False):
        x = np.array([point.values[c.name] for c in coordinates])
        if not stale:
            steps = 1e-6 * np.eye(2)
            ends = [(self.values(x + s) - self.values(x - s)) / 2e-6 for s in steps]
            self.jacobian = np.column_stack(ends)
        none = np.zeros(0)
        normal = trial_normal_equations(
            self.measured - self.values(x),
            self.jacobian,
            Whitening.of_white(0.01, self.measured),
            (),
            none,
            none,
        )
        return {"all": replace(normal, stale=stale)}


@pytest.mark.parametrize("count", [100, 100_000])
@pytest.mark.parametrize("wrong", [0.0, 0.001])
def test_a_converged_fit_has_nothing_left_to_gain_however_many_data(count, wrong):
    measured = Curved(count, wrong)
    found = fit(measured, COORDINATES, Point({"size.of_it": 0.8, "width.of_it": 0.5}), iterations=100)
    assert found.converged
    assert found.variance_inflation == 1
    equations = measured.normal_equations(found.point, COORDINATES)
    now = objective(COORDINATES, equations, found.point, 1.0)
    assert now - within_reach(COORDINATES, equations, found.point) < FIT.converged_deviance
    if not wrong:
        off = [found.point.values[c.name] - v for c, v in zip(COORDINATES, TRUTH)]
        assert np.all(np.abs(off) < 4 * np.array(list(found.sd.values())))


@pytest.mark.parametrize("seed", range(6))
def test_a_step_with_scatter_at_its_limits_is_that_of_a_general_solver(seed):
    rng = np.random.default_rng(seed)
    coordinates = (Coordinate("a", "a"), Coordinate("b", "b"))
    trials, names = {}, ("one", "two", "three")
    rows, measured, sd = [], [], np.array([0.03])
    for k, name in enumerate(names):
        jacobian = rng.standard_normal((40, 2))
        residual = (
            jacobian @ [0.5, -0.4] + (0.8, -0.9, 0.02)[k] * jacobian[:, 0]
        )  # more scatter than is allowed
        residual += 0.1 * rng.standard_normal(40)
        now = np.array([0.05 * (k - 1)])
        trials[name] = trial_normal_equations(
            residual, jacobian, Whitening.of_white(0.1, residual), (0,), sd, now
        )
        own = np.zeros((40, 3))
        own[:, k] = jacobian[:, 0]
        rows.append(np.column_stack([jacobian, own]) / 0.1)
        measured.append(residual / 0.1)
    for k in range(3):  # the scatter's prior
        rows.append(np.eye(5)[2 + k : 3 + k] / sd)
        measured.append(-trials[names[k]].scatter_now / sd)
    limit = [OBJECTIVE.most_scatter_sd * sd[0] - trials[n].scatter_now[0] for n in names]
    low = [-OBJECTIVE.most_scatter_sd * sd[0] - trials[n].scatter_now[0] for n in names]
    bounds = ([-np.inf, -np.inf, *low], [np.inf, np.inf, *limit])
    theirs = optimize.lsq_linear(np.vstack(rows), np.concatenate(measured), bounds, tol=1e-14).x
    move = best_move(coordinates, trials, Point({"a": 0.0, "b": 0.0}), 1.0)
    assert move.step == pytest.approx(theirs[:2], abs=1e-5)
    assert [move.scatter[n][0] for n in names] == pytest.approx(list(theirs[2:]), abs=1e-5)
    assert move.promised > 0


@pytest.mark.parametrize(("away", "share"), [(0.12, 0.6), (0.06, 0.25), (0.03, 0.15)])
def test_the_bend_of_a_valley_is_followed_to_second_order(away, share):
    measured = Curved(1000)
    start = Point({"size.of_it": 0.4 * np.exp(1.1 * away), "width.of_it": 1.2 - away})
    equations = measured.normal_equations(start, COORDINATES)
    move = best_move(COORDINATES, equations, start, 1.0, longest=np.inf)

    def there(step):
        values = {n: v + s for (n, v), s in zip(start.values.items(), step)}
        return Point(values), measured.normal_equations(Point(values), COORDINATES, stale=True)

    bent = geodesic_move(
        COORDINATES, equations, there(OBJECTIVE.probe_share * move.step)[1], start, 1.0, 0.0, move
    )
    lowest = fit(measured, COORDINATES, start, iterations=100).deviance
    left = [objective(COORDINATES, *there(m.step)[::-1], 1.0) - lowest for m in (move, bent)]
    assert left[1] < share * left[0]


def test_a_fit_that_was_cut_short_says_so():
    found = fit(Curved(1000), COORDINATES, Point({"size.of_it": 3.0, "width.of_it": -1.0}), iterations=1)
    assert not found.converged


def test_a_fit_that_comes_from_far_is_not_given_up_while_it_gains():
    """One to beat that is better than where the first steps lead, and worse than where they end."""
    measured = Curved(1000)
    start = Point({"size.of_it": 3.0, "width.of_it": -1.0})
    best = fit(measured, COORDINATES, start, iterations=100)
    found = fit(measured, COORDINATES, start, iterations=100, beat=best.deviance + 200)
    assert best.converged
    assert found.iterations == best.iterations
    assert found.deviance == best.deviance
    without_hope = fit(measured, COORDINATES, start, iterations=100, beat=best.deviance - 1e6)
    assert without_hope.iterations < 5


def test_a_direction_that_many_values_share_alike_is_named():
    """Twelve values of which the data tell all but a common factor: each has a part of 1/sqrt(12) = 0.29."""
    coordinates = [Coordinate(f"value{k}", prior_sd=0.1) for k in range(12)]
    shared = np.full((12, 12), 1 / 12)  # the projection on the common direction
    covariance = 0.01 * (0.01 * (np.eye(12) - shared) + shared)
    (found,) = unidentifiable(coordinates, covariance)
    assert set(found.split(" * ")) == {c.name for c in coordinates}

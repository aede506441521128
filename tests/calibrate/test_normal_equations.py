"""The normal equations against dense linear algebra."""

import numpy as np
import pytest
from scipy import optimize

from srs_opt.calibrate.normal_equations import bounded_solve, trial_normal_equations
from srs_opt.calibrate.objective import projected
from srs_opt.calibrate.whiten import Whitening


def problem(seed=0, n=200, k=5):
    rng = np.random.default_rng(seed)
    jacobian = rng.standard_normal((n, k))
    residual = jacobian @ rng.standard_normal(k) * 0.1 + 0.3 * rng.standard_normal(n)
    return jacobian, residual


def test_eliminating_the_scatter_is_what_the_marginal_covariance_says():
    jacobian, residual = problem()
    scatter_sd = np.array([0.2, 0.5])
    normal = trial_normal_equations(
        residual, jacobian, Whitening.of_white(0.3, residual), (1, 3), scatter_sd, np.zeros(2)
    )
    part = jacobian[:, [1, 3]] * scatter_sd
    covariance = 0.09 * np.eye(len(residual)) + part @ part.T
    weight = np.linalg.inv(covariance)
    both = np.column_stack([jacobian, residual])
    assert normal.eliminated().matrix == pytest.approx(both.T @ weight @ both, rel=1e-8, abs=1e-8)
    log_det = np.linalg.slogdet(covariance)[1] - len(residual) * np.log(0.09)
    assert normal.eliminated().log_det == pytest.approx(log_det)


def test_scatter_at_the_point_is_carried_along():
    jacobian, residual = problem()
    sd, now = np.array([0.2, 0.5]), np.array([0.1, -0.3])
    shifted = residual - jacobian[:, [1, 3]] @ now
    at_zero = trial_normal_equations(
        residual, jacobian, Whitening.of_white(0.3, residual), (1, 3), sd, np.zeros(2)
    ).eliminated()
    moved = trial_normal_equations(
        shifted, jacobian, Whitening.of_white(0.3, shifted), (1, 3), sd, now
    ).eliminated()
    assert moved.matrix == pytest.approx(at_zero.matrix, rel=1e-8, abs=1e-6)


def test_lost_values_do_not_count():
    jacobian, residual = problem()
    holes = residual.copy()
    holes[::3] = np.nan
    seen = np.isfinite(holes)
    with_holes = trial_normal_equations(
        holes, jacobian, Whitening.of_white(0.3, holes), (0,), np.ones(1), np.zeros(1)
    )
    without = trial_normal_equations(
        residual[seen], jacobian[seen], Whitening.of_white(0.3, residual[seen]), (0,), np.ones(1), np.zeros(1)
    )
    assert with_holes.raw == pytest.approx(without.raw)
    assert with_holes.count == seen.sum()


@pytest.mark.parametrize("seed", range(5))
def test_bounds_are_those_of_a_general_solver(seed):
    jacobian, residual = problem(seed)
    lower = np.array([-0.02, -np.inf, 0.0, -np.inf, 0.01])
    normal = trial_normal_equations(
        residual, jacobian, Whitening.of_white(1.0, residual), (), np.zeros(0), np.zeros(0)
    ).eliminated()
    none = np.zeros(5)
    mine = bounded_solve(normal.matrix, range(5), none, none, lower)
    theirs = optimize.lsq_linear(jacobian, residual, (lower, np.full(5, np.inf)), tol=1e-12)
    assert mine.deviance == pytest.approx(2 * theirs.cost, rel=2e-3)
    assert np.all(mine.step >= lower - 1e-12)


def test_a_coordinate_leaves_its_bound_again():
    # the first unconstrained step breaks two bounds; at the optimum only one of them holds
    jacobian = np.array([[2.0, -2, -3], [-1, -1, 2], [0, -3, -1], [1, 2, 2]])
    residual = np.array([3.0, -2, 3, -3])
    normal = trial_normal_equations(
        residual, jacobian, Whitening.of_white(1.0, residual), (), np.zeros(0), np.zeros(0)
    ).eliminated()
    mine = bounded_solve(normal.matrix, range(3), np.zeros(3), np.zeros(3), np.zeros(3))
    theirs = optimize.lsq_linear(jacobian, residual, (0, np.inf), tol=1e-14)
    assert mine.deviance == pytest.approx(2 * theirs.cost, rel=1e-9)
    assert mine.deviance == pytest.approx(26.83, abs=0.01)


@pytest.mark.parametrize("seed", range(20))
def test_bounds_and_priors_are_those_of_a_general_solver(seed):
    rng = np.random.default_rng(seed)
    jacobian, residual = rng.standard_normal((12, 6)), 3 * rng.standard_normal(12)
    precision, offset = rng.uniform(0, 2, 6) * (rng.random(6) < 0.5), rng.standard_normal(6)
    lower = np.where(rng.random(6) < 0.7, rng.uniform(-0.3, 0.3, 6), -np.inf)
    normal = trial_normal_equations(
        residual, jacobian, Whitening.of_white(1.0, residual), (), np.zeros(0), np.zeros(0)
    ).eliminated()
    mine = bounded_solve(normal.matrix, range(6), precision, offset, lower)
    root = np.sqrt(precision)
    matrix = np.concatenate([jacobian, np.diag(root)])
    wanted = np.concatenate([residual, -root * offset])
    theirs = optimize.lsq_linear(matrix, wanted, (lower, np.full(6, np.inf)), tol=1e-14)
    assert mine.step == pytest.approx(theirs.x, abs=1e-6)
    assert mine.deviance == pytest.approx(2 * theirs.cost, rel=1e-9)
    assert np.all(np.diag(mine.covariance)[mine.step <= lower + 1e-9] == 0)


def scattered(seed=0):
    jacobian, residual = problem(seed)
    sd, now = np.array([0.02, 0.05]), np.array([0.01, -0.03])
    return (
        jacobian,
        residual,
        trial_normal_equations(residual, jacobian, Whitening.of_white(0.3, residual), (1, 3), sd, now),
        sd,
        now,
    )


def test_what_the_linearisation_promises_is_the_plain_sum_of_squares():
    jacobian, residual, normal, sd, now = scattered()
    step, moved = np.linspace(-0.2, 0.3, 5), np.array([0.03, -0.01])
    rest = residual - jacobian @ step - jacobian[:, [1, 3]] @ moved
    direct = rest @ rest / 0.09 / 2.5 + np.sum(((now + moved) / sd) ** 2)
    assert normal.after(step, moved, 2.5) == pytest.approx(direct)


def test_the_pull_on_the_scatter_is_minus_half_the_gradient():
    _, _, normal, _, _ = scattered()
    step, moved, h = np.linspace(-0.2, 0.3, 5), np.array([0.03, -0.01]), 1e-6
    for k, pull in enumerate(normal.pull(step, moved, 2.5)):
        ends = [normal.after(step, moved + s * h * np.eye(2)[k], 2.5) for s in (1, -1)]
        assert pull == pytest.approx(-(ends[0] - ends[1]) / (2 * h) / 2, rel=1e-4)


def test_scatter_that_is_held_is_a_constant_of_the_elimination():
    jacobian, residual, normal, sd, now = scattered()
    held = normal.eliminated(2.0, np.array([np.nan, 0.07]))
    shifted = residual - 0.07 * jacobian[:, 3]
    alone = trial_normal_equations(
        shifted, jacobian, Whitening.of_white(0.3, shifted), (1,), sd[:1], now[:1]
    ).eliminated(2.0)
    matrix = alone.matrix.copy()
    matrix[-1, -1] += ((now[1] + 0.07) / sd[1]) ** 2
    assert held.matrix == pytest.approx(matrix, rel=1e-8, abs=1e-6)
    assert held.back[1, -1] == pytest.approx(0.07)
    assert np.all(held.back[1, :-1] == 0)


def test_what_is_projected_out_does_not_depend_on_units():
    """Coordinates in units 1e9 apart, as stiffnesses and time constants are."""
    jacobian, _ = problem()
    units = np.array([1e-6, 1.0, 1e3, 1.0, 1.0])
    total = (jacobian * units).T @ (jacobian * units)
    inverse, left = projected(total, 3, np.zeros(3))
    basis, _ = np.linalg.qr(jacobian[:, :3])
    rest = jacobian[:, 3:] - basis @ (basis.T @ jacobian[:, 3:])
    assert left == pytest.approx(rest.T @ rest, rel=1e-9)
    own = np.linalg.inv(jacobian[:, :3].T @ jacobian[:, :3])
    assert inverse * np.outer(units[:3], units[:3]) == pytest.approx(own, rel=1e-9)

"""The familywise test on data whose law is known."""

import numpy as np

from srs_opt.calibrate.normal_equations import trial_normal_equations
from srs_opt.calibrate.whiten import Whitening
from srs_opt.discrepancy.detect import detect, project

GROUPS = ((0, 1), (2, 3, 4), (5,), (1, 5))


def one(seed, gap=0.0):
    """Fit 3 coordinates to 10 trials with scatter; test 6 further columns."""
    rng = np.random.default_rng(seed)
    sd, scatter_sd = 0.5, np.array([0.3])
    total = 0
    truth = 0.2 * rng.standard_normal(3)
    for _ in range(10):
        jacobian = rng.standard_normal((60, 9))
        own = np.zeros(9)
        own[:3] = truth
        own[0] += scatter_sd[0] * rng.standard_normal()
        own[5] += gap
        residual = jacobian @ own + sd * rng.standard_normal(60)
        whiten = Whitening.of_white(sd, residual)
        normal = trial_normal_equations(residual, jacobian, whiten, (0,), scatter_sd, np.zeros(1))
        total = total + normal.eliminated().matrix
    score, covariance = project(total, range(3), range(3, 9), np.full(3, 25.0), np.zeros(3))
    return detect(score, covariance, GROUPS, np.zeros(10), np.random.default_rng(seed)).p_value


def test_false_alarms_come_at_their_level():
    from scipy import stats

    alarms = sum(one(seed) < 0.05 for seed in range(200))
    low, high = stats.binomtest(alarms, 200).proportion_ci(0.99)
    assert low <= 0.05 <= high


def test_a_gap_is_seen():
    assert one(1, gap=0.3) < 0.001

"""What the laboratory's camera and notebook add, each with the size that was asked for."""

from dataclasses import replace

import numpy as np
import pytest

from virtual_lab.camera import label_times
from virtual_lab.dataset import Recording
from virtual_lab.disturb import Disturbances, disturbed, mistaken
from virtual_lab.errors import LabError
from virtual_lab.trials import small_design

TRIALS = small_design(np.random.default_rng(0), 8.0)
LABELS = label_times(8.0, 120.0)


def added(how, sd=0.001):
    """Return what is added to markers a pitch apart that stand still, (trials, T, M, 2)."""
    still = np.broadcast_to(np.arange(5)[None, :, None] * [0.1, 0.0], (len(LABELS), 5, 2))
    return np.array(
        [
            disturbed(still, t, LABELS, how, sd, np.random.default_rng(k), np.random.default_rng(99)) - still
            for k, t in enumerate(TRIALS)
        ]
    )


def test_nothing_by_default():
    assert not added(Disturbances()).any()


def test_correlated_noise_has_its_size_and_time():
    noise = added(Disturbances(correlated_sd_m=0.0002, correlation_s=0.2))
    assert noise.std() == pytest.approx(0.0002, rel=0.05)
    lag = 24  # 0.2 s
    assert np.mean(noise[:, lag:] * noise[:, :-lag]) / noise.var() == pytest.approx(np.exp(-1), abs=0.06)
    assert abs(np.mean(noise[:, :, 0, 0] * noise[:, :, 1, 0])) < 0.1 * noise.var()  # each marker's its own


def test_drift_is_rigid_and_slow():
    drift = added(Disturbances(drift_m=0.001))
    assert np.ptp(drift, axis=2).max() < 1e-12
    way = np.linalg.norm(drift[:, :, 0], axis=-1)
    assert np.allclose(way[:, 0], 0) and np.allclose(way[:, -1], 0.001)


def test_outliers_have_their_share_and_stand_out():
    far = np.linalg.norm(added(Disturbances(outlier_share=0.01)), axis=-1)
    assert np.mean(far > 0) == pytest.approx(0.01, rel=0.15)
    assert far[far > 0].min() >= 0.005 and far.max() <= 0.03


def test_swaps_exchange_neighbours():
    swapped = added(Disturbances(swap_share=0.05))
    assert 0.03 < np.mean(np.any(swapped[..., 0] != 0, axis=-1)) < 0.08
    assert np.unique(np.round(np.abs(swapped), 9)).tolist() == [0.0, 0.1]


def test_systematic_error_repeats_with_the_gait():
    error = added(Disturbances(systematic_sd_m=0.0001))
    assert np.sqrt(np.mean(error**2)) == pytest.approx(0.0001, rel=0.5)
    one = disturbed(np.zeros((len(LABELS), 5, 2)), replace(TRIALS[0], heading_rad=1.0), LABELS,
                    Disturbances(systematic_sd_m=0.0001), 0.001,
                    np.random.default_rng(7), np.random.default_rng(99))  # fmt: skip
    assert np.allclose(one, error[0])


@pytest.mark.parametrize("kind", ["phase_sign", "frequency", "other_robot"])
def test_one_trial_is_entered_wrongly(kind):
    noted, index, factors = mistaken(TRIALS, kind, np.random.default_rng(3))
    others = [k for k in range(len(TRIALS)) if k != index]
    assert all(noted[k] == TRIALS[k] for k in others)
    assert (noted[index] != TRIALS[index]) == (kind != "other_robot")
    assert (factors.curvature != 1) == (kind == "other_robot")


def test_bad_disturbances_are_refused():
    for wrong in ({"outlier_share": 0.9}, {"correlation_s": 0.0}, {"wrong_entry": "colour"}):
        with pytest.raises(LabError):
            Recording(**wrong)

"""Free valves: rounding keeps what it must, and one interval per segment comes back to the wave."""

import numpy as np
import pytest

from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.free import intervals_of, merged, notched, search_free, sum_up
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.robot import wpi_srs


def test_sum_up_rounding_stays_within_one_step():
    levels = np.random.default_rng(3).uniform(-1, 1, 200)
    on = sum_up(levels)
    owed = np.cumsum(levels - np.where(on, 1.0, -1.0))
    assert np.abs(owed).max() <= 1.0 + 1e-12


def test_intervals_wrap_round_the_cycle():
    on = np.array([True, True, False, False, True, False, False, True])
    assert intervals_of(on) == [(0.5, 0.625), (0.875, 1.25)]


def test_short_pulses_go_and_long_ones_are_cut():
    pulses = [(0.1, 0.11), (0.3, 0.6), (0.62, 0.8)]
    kept = merged(pulses, 0.05, 2)
    assert kept == [(0.3, 0.8)]
    cut = notched(kept, 0.04, 2)
    assert cut == pytest.approx(np.array([(0.3, 0.53), (0.57, 0.8)]))


@pytest.mark.slow
def test_one_interval_is_the_wave():
    freed = search_free(CycleProblem((wpi_srs(),), "complex", Goal(), Limits()), starts=1)
    told = freed.record()
    assert freed.found.certificate.passed
    assert freed.rounded is not None
    assert freed.rounded.certificate.passed
    assert told["speed_m_s"] == pytest.approx(told["wave_speed_m_s"], rel=0.005)
    assert told["wave_speed_m_s"] > 0.545
    assert told["relaxed_speed_m_s"] > told["wave_speed_m_s"]
    assert told["switches_per_s"] == pytest.approx(16.0, rel=0.1)

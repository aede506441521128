"""Free valves: rounding keeps what it must, and one interval per segment comes back to the wave."""

import numpy as np
import pytest

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Wave
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.corrections import steered
from srs_opt.gait_opt.free import intervals_of, merged, notched, repeated, search_free, sum_up
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


def test_a_repeated_wave_is_the_same_motion():
    wave = Wave(3.0, 45.0, (0.2, 1.0, 1.9, 2.6), (0.1, 0.2, 0.15, 0.3)).gait()
    twice = repeated(wave, 2)
    assert twice.frequency_hz == pytest.approx(1.5)
    for t in np.linspace(0.0, twice.period_s, 50, endpoint=False):
        assert twice.valve(t + 1e-4) == pytest.approx(wave.valve(t + 1e-4))


@pytest.mark.slow
def test_two_intervals_find_the_wave_at_twice_the_frequency():
    freed = search_free(CycleProblem((wpi_srs(),), "complex", Goal(), Limits(), intervals=2), starts=1)
    assert freed.found.certificate.passed
    assert freed.found.certificate.speed_m_s >= 0.62
    assert freed.waves[1].frequency_hz > 2.0


@pytest.mark.slow
def test_one_interval_is_the_wave():
    freed = search_free(CycleProblem((wpi_srs(),), "complex", Goal(), Limits()), starts=1)
    told = freed.record()
    assert freed.found.certificate.passed
    assert freed.free is not None
    assert freed.free.certificate.passed
    assert told["rounded_speed_m_s"] == pytest.approx(told["wave_speed_m_s"], rel=0.005)
    assert told["wave_speed_m_s"] > 0.545
    assert told["relaxed_speed_m_s"] > told["wave_speed_m_s"]
    assert told["switches_per_s"] == pytest.approx(16.0, rel=0.1)


def test_steering_without_a_steady_state_leaves_the_gait_alone():
    gait = Wave.uniform(4, 2.0, 40.0, 0.9).gait()

    def none(other):
        raise NoAnswerError("no steady state")

    def some(other):  # none right beyond the gait itself
        return 1.0 if other == gait else none(other)

    def with_a_hole(other):  # on the way to the root between
        bias = (other.intervals[0][0][1] - other.intervals[0][0][0] - 0.25) / 0.5
        return none(other) if -0.018 < bias < -0.002 else 1.0 + 60 * bias

    assert steered(gait, none, 0.1) == gait
    assert steered(gait, some, 0.1) == gait
    assert steered(gait, with_a_hole, 1e-3).segments == 4

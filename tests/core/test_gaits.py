"""Gaits as on-intervals: the valve wave (13), mirrors, reversal, ticks, refusals."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from srs_opt.errors import InputError
from srs_opt.gait import Gait, Wave, published_wave
from srs_opt.robot import wpi_srs
from srs_opt.simulate.timeline import Timeline

PHASE, OFFSET = st.floats(-20, 20), st.floats(-0.99, 0.99)


def away_from_switches(gait, times):
    edges = np.concatenate([gait.switch_times_s(), gait.switch_times_s() + gait.period_s, [0, gait.period_s]])
    return [t for t in times if np.abs(edges - t).min() > 1e-6]


@settings(max_examples=80, deadline=None)
@given(st.floats(0.05, 20), st.lists(st.tuples(PHASE, OFFSET), min_size=1, max_size=5))
def test_the_wave_is_the_sign_of_the_shifted_sine(hertz, pairs):
    wave = Wave(hertz, 50.0, tuple(p for p, _ in pairs), tuple(o for _, o in pairs))
    gait = wave.gait()
    assert gait.segments == len(pairs)
    for t in away_from_switches(gait, np.linspace(0, 1 / hertz, 41)):
        value = np.sin(2 * np.pi * hertz * t + np.array(wave.phase_rad)) + np.array(wave.offset)
        clear = abs(value) > 1e-6
        np.testing.assert_array_equal(gait.valve(t)[clear], np.sign(value)[clear])
    for (interval,), phi in zip(gait.intervals, wave.offset):
        duty = (interval[1] - interval[0]) % gait.period_s / gait.period_s
        assert duty == pytest.approx(0.5 + math.asin(phi) / math.pi, abs=1e-6)


@st.composite
def gaits(draw):
    period = draw(st.floats(0.1, 5))
    intervals = []
    for _ in range(draw(st.integers(1, 4))):
        count = draw(st.integers(1, 3))
        ticks = sorted(draw(st.sets(st.integers(0, 999), min_size=2 * count, max_size=2 * count)))
        edges = [k * period / 1000 for k in ticks]
        if draw(st.booleans()):
            edges = edges[1:] + edges[:1]  # the last interval wraps past the period's end
        intervals.append(tuple(zip(edges[::2], edges[1::2])))
    return Gait(period, 50.0, tuple(intervals))


@settings(max_examples=80, deadline=None)
@given(gaits())
def test_mirror_reversal_and_phases_say_what_the_valves_do(gait):
    times = away_from_switches(gait, (np.arange(500) + 0.5) * gait.period_s / 500)
    mirrored, backwards = gait.mirrored(), gait.reversed_wave()
    for t in times:
        np.testing.assert_array_equal(mirrored.valve(t), -gait.valve(t))
    for t in times:
        np.testing.assert_array_equal(backwards.valve(gait.period_s - t), gait.valve(t))
    assert mirrored.mirrored().phases()[0] == pytest.approx(gait.phases()[0])
    durations, valves = gait.phases()
    assert durations.sum() == pytest.approx(gait.period_s)
    assert (durations > 0).all()
    middles = np.cumsum(durations) - durations / 2
    for t, valve in zip(middles, valves.T):
        np.testing.assert_array_equal(gait.valve(t), valve)
    assert gait.switches_per_s == pytest.approx(2 * sum(map(len, gait.intervals)) / gait.period_s)


@settings(max_examples=100, deadline=None)
@given(gaits())
def test_shortest_dwell_is_what_dense_sampling_sees(gait):
    times = np.arange(2000) * gait.period_s / 2000 + gait.period_s / 4000
    valves = np.array([gait.valve(t) for t in times]).T
    runs = []
    for row in valves:
        changes = np.flatnonzero(row != np.roll(row, 1))
        runs.append(np.diff([*changes, changes[0] + row.size]).min() * gait.period_s / 2000)
    assert gait.shortest_dwell_s() == pytest.approx(min(runs), abs=gait.period_s / 900)


def test_phases_of_the_published_gait():
    gait = published_wave(wpi_srs()).gait()
    durations, valves = gait.phases()
    np.testing.assert_allclose(durations, 0.125)
    assert valves.shape == (4, 4)
    np.testing.assert_array_equal(valves[0], -valves[2])


def test_whole_ticks():
    gait = Wave.uniform(4, 1.73, 50, 0.97, 0.3).gait().on_ticks(0.005)
    for value in (gait.period_s, *[t for pairs in gait.intervals for pair in pairs for t in pair]):
        assert value / 0.005 == pytest.approx(round(value / 0.005), abs=1e-9)
    with pytest.raises(InputError, match="no length"):
        Wave.uniform(4, 1.73, 50, 0.97, 0.999).gait().on_ticks(0.1)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((0.0, 50, (((0, 0.5),),)), "period must be above 0"),
        ((math.inf, 50, (((0, 0.5),),)), "period must be above 0"),
        ((1.0, -1, (((0, 0.5),),)), "pressure must be at least 0"),
        ((1.0, math.nan, (((0, 0.5),),)), "pressure must be at least 0"),
        ((1.0, 50, (((0, 0.5),), ((0, 1.0),))), r"segment 2: switch times must lie in \[0, 1\)"),
        ((1.0, 50, (((0.3, 0.3),),)), "no length"),
        ((1.0, 50, (((0.0, 0.5), (0.4, 0.6)),)), "overlap near 0.4"),
        ((1.0, 50, (((0.8, 0.2), (0.1, 0.4)),)), "overlap near 0.1"),
        ((1.0, 50, (((0.8, 0.2), (0.9, 0.1)),)), "overlap"),
        ((1.0, 50, ((),)), "never switches"),
    ],
)
def test_impossible_gaits_are_refused(arguments, words):
    with pytest.raises(InputError, match=words):
        Gait(*arguments)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((0.0, 50, (0.0,), (0.0,)), "frequency must be above 0"),
        ((math.nan, 50, (0.0,), (0.0,)), "finite"),
        ((1.0, 50, (0.0, 1.0), (0.0,)), "2 phases but 1 offsets"),
        ((1.0, 50, (0.0, 1.0), (0.0, -1.0)), "offset of segment 2 is -1: .* no steady gait"),
    ],
)
def test_impossible_waves_are_refused(arguments, words):
    with pytest.raises(InputError, match=words):
        Wave(*arguments)


def test_reversal_of_a_switch_just_after_zero_stays_in_the_period():
    gait = Gait(1.0, 50.0, (((0.2, 1e-20),),))
    assert gait.reversed_wave().intervals == (((0.0, 0.8),),)


def test_timelines_cut_join_and_delay():
    gait = published_wave(wpi_srs()).gait()
    whole = Timeline.of_gait(gait, 1.3)
    assert whole.end_s == pytest.approx(1.3)
    both = Timeline.join([whole, Timeline.vent(4, 0.2, 0.0)])
    assert both.end_s == pytest.approx(1.5)
    assert both.until(1.4).end_s == pytest.approx(1.4)
    assert both.until(0.125).duration_s.size == 1
    assert whole.delayed(0.0) is whole
    assert whole.delayed(0.1).end_s == pytest.approx(1.3)
    assert (whole.delayed(5.0).valve == 0).all()
    assert not Timeline.of_gait(gait, 0.0).duration_s.size

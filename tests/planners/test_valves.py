"""Joining cycles: dwell, tick and pressure, counted on the valves' own record, for gaits of any kind."""

import numpy as np
import pytest

from planners.motion.valves import Joints, ValveLimits, playable
from srs_opt.errors import InputError
from srs_opt.gait import Gait
from srs_opt.gait_opt.table import GaitTable, TableGait
from srs_opt.simulate.timeline import Timeline

TICK_S = 0.001


def table_of(gaits):
    entries = [
        TableGait(f"g{k}", g, 0.1, 0.0, None, (0.03, 0.03), (0.1, 0, 0), 0.1) for k, g in enumerate(gaits)
    ]
    return GaitTable("any", "", "complex", tuple(entries))


def random_gait(rng, dwell_ticks):
    """One or two intervals per segment on whole ticks, anywhere in the cycle."""
    period = int(rng.integers(8 * dwell_ticks, 30 * dwell_ticks))
    rows = []
    for _ in range(4):
        count = int(rng.integers(1, 3))
        spare = rng.multinomial(period - 2 * count * dwell_ticks, np.ones(2 * count) / (2 * count))
        switches = (np.cumsum(spare + dwell_ticks) + rng.integers(period)) % period
        rows.append(tuple((switches[2 * k] * TICK_S, switches[2 * k + 1] * TICK_S) for k in range(count)))
    return Gait(period * TICK_S, float(rng.uniform(20, 60)), tuple(rows))


def held(timeline):
    """Return every segment's holds: lists of (state, begin, end)."""
    ends = np.cumsum(timeline.duration_s)
    rows = []
    for states in timeline.valve:
        row = []
        for state, begin, end in zip(states, [0.0, *ends], ends):
            if row and row[-1][0] == state:
                row[-1] = (state, row[-1][1], end)
            else:
                row.append((state, begin, end))
        rows.append(row)
    return rows


@pytest.mark.parametrize("dwell_s", [0.02, 0.0355, 0.1])
def test_any_order_of_gaits_keeps_dwell_and_tick(dwell_s):
    rng = np.random.default_rng(5)
    limits = ValveLimits(dwell_s, TICK_S)
    gaits = [random_gait(rng, round(limits.dwell_s / TICK_S)) for _ in range(12)]
    joints = Joints(table_of(gaits), limits)
    refused = 0
    for _ in range(30):
        before, parts = joints.rest, []
        for now in map(int, rng.integers(0, 12, 25)):
            if joints.joint(before, now) is None:
                refused += 1
                continue
            parts.append(joints.timeline(before, now))
            assert parts[-1].end_s == pytest.approx(gaits[now].period_s)
            before = now
        played = Timeline.join([*parts, joints.vent(before, 1.0)])
        for row in held(played):
            assert all(end - begin > dwell_s - 1e-9 for _, begin, end in row)
            ticks = np.array([begin for _, begin, _ in row]) / TICK_S
            assert np.abs(ticks - np.round(ticks)).max() < 1e-5
    assert refused < 30 * 25 // 10


def test_a_joining_cycle_changes_as_little_as_dwell_asks():
    """A switch 4 ms after the joint waits 12 ms; where the pulse after it is shorter, it is left out."""
    one = Gait(0.4, 40.0, (((0.1, 0.396),),) * 4)  # stands off for 4 ms at the end
    soon = Gait(0.4, 40.0, (((0.004, 0.2),),) * 4)
    joints = Joints(table_of([one, soon]), ValveLimits(0.02, TICK_S))
    assert joints.joint(0, 1).gait.intervals[0][0] == pytest.approx((0.016, 0.2))
    pulse = Gait(0.4, 40.0, (((0.002, 0.006), (0.1, 0.2)),) * 4)
    joints = Joints(table_of([one, pulse]), ValveLimits(0.02, TICK_S))
    assert joints.joint(0, 1).gait.intervals[0][0] == pytest.approx((0.1, 0.2))


def test_a_gait_after_itself_and_after_rest_is_its_own_where_it_can_be():
    gait = Gait(0.4, 40.0, (((0.1, 0.3),),) * 4)
    joints = Joints(table_of([gait]))
    assert joints.is_plain(0, 0) and joints.is_plain(joints.rest, 0)
    early = Gait(0.4, 40.0, (((0.003, 0.3),),) * 4)
    assert Joints(table_of([early])).joint(1, 0).gait.intervals[0] == ((0.0, 0.3),)


@pytest.mark.parametrize("rate", [None, 100.0])
def test_pressure_goes_linearly(rate):
    low, high = (Gait(0.4, p, (((0.1, 0.3),),) * 4) for p in (30.0, 50.0))
    joints = Joints(table_of([low, high]), ValveLimits(pressure_rate_kpa_s=rate))
    ramp_s = 0.1 if rate is None else 20.0 / rate
    timeline = joints.timeline(0, 1)
    ends = np.cumsum(timeline.duration_s)
    middles = ends - timeline.duration_s / 2
    wanted = np.interp(middles, [0, ramp_s], [30.0, 50.0])
    assert timeline.pressure_kpa == pytest.approx(wanted)
    assert timeline.pressure_kpa @ timeline.duration_s == pytest.approx(50 * 0.4 - 10 * ramp_s)


def test_a_change_of_pressure_longer_than_the_cycle_is_refused():
    low, high = (Gait(0.4, p, (((0.1, 0.3),),) * 4) for p in (30.0, 50.0))
    joints = Joints(table_of([low, high]), ValveLimits(pressure_rate_kpa_s=40.0))
    assert joints.joint(0, 1) is None and joints.joint(0, 0) is not None


def test_gaits_are_rounded_to_ticks_and_short_ones_left_out(robot, gaits):
    table = playable(robot, gaits, ValveLimits())
    for entry in table.gaits:
        times = np.array([entry.gait.period_s, *entry.gait.switch_times_s()]) / TICK_S
        assert np.abs(times - np.round(times)).max() < 1e-6
    assert table.gaits[0].speed_m_s == pytest.approx(gaits.gaits[0].speed_m_s, rel=0.01)
    longest = max(entry.gait.shortest_dwell_s() for entry in gaits.gaits)
    with pytest.raises(InputError, match="--min-dwell"):
        playable(robot, gaits, ValveLimits(min_dwell_s=longest + 0.01))

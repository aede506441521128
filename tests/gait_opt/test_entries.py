"""Entries of gait tables: certified, with their settling times, moved to another tick."""

from dataclasses import replace

import numpy as np
import pytest

from srs_opt.gait_opt.catalogue import default_table, shipped_table
from srs_opt.gait_opt.corrections import within
from srs_opt.gait_opt.driver import Motion, driver_gaits
from srs_opt.gait_opt.entries import certified_table
from srs_opt.gait_opt.family import images
from srs_opt.gait_opt.goal import Limits
from srs_opt.gait_opt.table import GaitTable, TableGait, load_table, save_table
from srs_opt.gait_opt.ticks import Schedule
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs

ROBOT = wpi_srs()


@pytest.fixture(scope="module")
def table() -> GaitTable:
    return shipped_table()


def test_every_entry_carries_its_certificate(table, tmp_path):
    for entry in table.gaits:
        assert entry.certificate.self_clearance_m > 0
        decay = np.exp(-entry.gait.period_s / entry.settling_s)
        assert decay == pytest.approx(entry.certificate.largest_floquet_multiplier)
    assert load_table(save_table(table, tmp_path / "t.json"), ROBOT) == table


def test_claims_are_those_of_the_collocation(table):
    """A claim copied from the simulation would have no error; one from elsewhere has a small one."""
    errors = np.array([e.certificate.relative_error for e in table.gaits if abs(e.speed_m_s) > 0.02])
    assert 1e-6 < np.median(errors) < 2e-4
    assert errors.max() < 5e-3


@pytest.mark.parametrize("turn_rate_rad_s", [0.0, 0.5, -0.5])
def test_a_driver_finds_gaits_from_standing_still_to_fast(table, turn_rate_rad_s):
    for speed in np.arange(-0.55, 0.56, 0.05) if turn_rate_rad_s else np.arange(0.02, 0.56, 0.03):
        for sign in (1, -1):
            found = table.nearest(sign * speed, turn_rate_rad_s)
            assert found is not None, (sign * speed, turn_rate_rad_s)
            orbit = steady_gait(ROBOT, found.gait) if abs(speed) < 0.06 else found
            assert orbit.speed_m_s == pytest.approx(sign * speed, abs=0.05)
            assert orbit.turn_rate_rad_s == pytest.approx(turn_rate_rad_s, abs=0.5)
    assert table.nearest(0.0, 0.9).turn_rate_rad_s > 0.8
    assert table.nearest(0.0, -0.9).turn_rate_rad_s < -0.8


def test_planners_keep_their_gaits(table):
    planned = default_table(ROBOT)
    assert planned == table.for_planning()
    assert planned.gaits == table.gaits[: len(planned.gaits)]
    assert min(abs(gait.speed_m_s) for gait in planned.gaits) > 0.2


def test_a_driver_gets_gaits_for_another_robot(table):
    """Four links and soft valves: the search knows nothing of the built-in robot."""
    robot = ROBOT.with_values(links=4, tau1_s=0.12)
    limits = Limits(pressure_kpa=(20.0, 55.0))
    asked = Motion(0.05, 0.0), Motion(0.1, 0.5), Motion(0.0, 0.3)
    found = driver_gaits(
        robot, "complex", limits, lambda n, g: images(robot, "complex", n, g, 1e-3), wanted=asked
    )
    assert {e.name.split()[0] for e in found} == {"slow", "pivot"}
    assert len(found) == 2 + 4 + 2
    for entry, motion in zip(found[::2], (asked[0], asked[1], asked[1], asked[2])):
        sign = -1 if " back" in entry.name else 1
        assert sign * entry.speed_m_s == pytest.approx(motion.speed_m_s, abs=0.025)
        assert abs(entry.turn_rate_rad_s) == pytest.approx(motion.turn_rate_rad_s, abs=0.25)


def test_entries_that_overlap_themselves_are_left_out(table):
    """A robot that bends four times as far lies across itself at full pressure."""
    bendy = ROBOT.with_values(curvature_per_pressure_1_m_kpa=1.6)
    entries = []
    for name, pressure_kpa in (("flat", 20.0), ("rolled", 55.0)):
        gait = within(Limits((0.5, 0.5), (pressure_kpa, pressure_kpa)), table["fast"].gait)
        entries.append(TableGait.of_orbit(name, steady_gait(bendy, gait)))
    built = GaitTable(bendy.name, bendy.fingerprint(), "complex", tuple(entries))
    said: list[str] = []
    kept = certified_table(bendy, built, Limits((0.5, 1.0), (20.0, 55.0)), said.append)
    assert [g.name for g in kept.gaits] == ["flat"]
    (line,) = said
    assert line.startswith("rolled: left out")
    assert "the body overlaps itself by 38.5 mm" in line


def test_a_table_moves_to_a_coarser_tick_and_keeps_its_motions(table):
    names = ("fast", "fast R0.176 back right")
    short = replace(table, gaits=tuple(table[name] for name in names))
    moved = certified_table(ROBOT, short, Limits(pressure_kpa=(20.0, 55.0), tick_s=0.01), on_other_ticks=True)
    assert tuple(g.name for g in moved.gaits) == names
    for entry in moved.gaits:
        assert Schedule.of_gait(entry.gait, 0.01).period == round(entry.gait.period_s / 0.01)
        assert entry.speed_m_s == pytest.approx(table[entry.name].speed_m_s, abs=0.006)
        assert entry.turn_rate_rad_s == pytest.approx(table[entry.name].turn_rate_rad_s, abs=0.08)
        assert entry.certificate is not None

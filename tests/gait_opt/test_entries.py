"""Entries of gait tables: certified, with their settling times, moved to another tick."""

from dataclasses import replace

import numpy as np
import pytest

from srs_opt.gait_opt.aim import within
from srs_opt.gait_opt.catalogue import shipped_table
from srs_opt.gait_opt.entries import certified_table
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

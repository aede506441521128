"""Gait tables for several robots: chosen by what each makes of a gait."""

import numpy as np
import pytest

from srs_opt.gait_opt import companions
from srs_opt.gait_opt.catalogue import shipped_table
from srs_opt.gait_opt.goal import Limits
from srs_opt.gait_opt.robust import in_the_middle, of_stiffness, spread
from srs_opt.gait_opt.robust_table import robust_table
from srs_opt.gait_opt.table import GaitTable, load_table, save_table
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs

STIFFNESSES = (0.002, 0.02, 0.005)


def test_the_middle_robot_is_the_nominal_one_and_knows_how_far_it_may_be_off():
    nominal, *others = in_the_middle([of_stiffness(wpi_srs(), ei) for ei in STIFFNESSES])
    assert nominal.bending_stiffness_n_m2 == 0.005
    assert [r.bending_stiffness_n_m2 for r in others] == [0.002, 0.02]
    sd = nominal.relative_sd["bending_stiffness_n_m2"]
    assert 0.005 * np.exp(2 * sd) == pytest.approx(0.02)


def test_actuators_that_are_off_stand_beside_the_softest_and_the_stiffest_body():
    robots = spread([of_stiffness(wpi_srs(), ei) for ei in STIFFNESSES], 0.1)
    assert len(robots) == 3 + 2 * 2 * 2
    assert {r.bending_stiffness_n_m2 for r in robots[3:]} == {0.002, 0.02}
    assert sorted({round(r.curvature_per_pressure_1_m_kpa / 0.35, 9) for r in robots}) == [0.9, 1.0, 1.1]
    assert sorted({round(r.tau1_s / r.tau2_s, 9) for r in robots}) == [1.6]
    assert len(spread([wpi_srs()], 0.1)) == 5


def test_a_table_for_unknown_stiffness_leads_with_the_robust_gait(monkeypatch, tmp_path):
    monkeypatch.setattr(companions, "OFFSETS", (0.0,))
    robots = in_the_middle([of_stiffness(wpi_srs(), ei) for ei in STIFFNESSES])
    shipped = shipped_table()
    few = GaitTable(shipped.robot_name, shipped.fingerprint, shipped.model, (shipped["fast"],))
    table = robust_table(robots, "compliant", few, Limits(pressure_kpa=(20.0, 55.0)))
    names = [g.name for g in table.gaits]
    assert names[0].startswith("robust") and names[-1] == "fast"
    assert table.fingerprint == robots[0].fingerprint()
    first = table.gaits[0]
    speeds = [abs(steady_gait(r, first.gait).speed_m_s) for r in robots]
    assert first.worst_speed_m_s == pytest.approx(min(speeds)) and min(speeds) > 0.45
    assert table["fast"].worst_speed_m_s < 0.2
    assert load_table(save_table(table, tmp_path / "t.json"), robots[0]) == table

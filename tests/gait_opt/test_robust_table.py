"""Gait tables for several robots: chosen by what each makes of a gait."""

from dataclasses import replace

import numpy as np
import pytest

from srs_opt.gait_opt import any_table, catalogue, companions
from srs_opt.gait_opt.__main__ import main
from srs_opt.gait_opt.catalogue import cached_table_path, default_table, shipped_table
from srs_opt.gait_opt.robust import in_the_middle, of_stiffness, spread
from srs_opt.gait_opt.table import GaitTable, load_table
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import load_robot, wpi_srs

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


@pytest.fixture
def few(monkeypatch, tmp_path):
    """Two gaits in place of the shipped table, one of them for drivers; what is kept, is kept in a folder."""
    monkeypatch.setattr(companions, "COMPANION", replace(companions.COMPANION, offsets=(0.0,)))
    shipped = shipped_table()
    gaits = (shipped["fast"], next(g for g in shipped.gaits if not g.planned))
    table = GaitTable(shipped.robot_name, shipped.fingerprint, shipped.model, gaits)
    monkeypatch.setattr(catalogue, "shipped_table", lambda: table)
    for module in (catalogue, any_table):
        monkeypatch.setattr(
            module, "cached_table_path", lambda *asked: tmp_path / "kept" / cached_table_path(*asked).name
        )
    return table


def test_the_table_of_a_robot_of_unknown_stiffness_is_the_robust_one(few, tmp_path, capsys):
    """Nobody has to know of --stiffness: what `--table` writes serves whatever the segments are."""
    out = tmp_path / "out"
    assert main(["--table", "--jobs", "1", "--out", str(out)]) == 0
    told = capsys.readouterr()
    assert "gives no bending stiffness" in told.err and "--model complex" in told.err
    nominal = load_robot(out / "nominal_robot.yaml")
    table = load_table(out / "gait_table.json", nominal)
    assert nominal.bending_stiffness_n_m2 == 0.005
    first = table.gaits[0]
    speeds = [abs(steady_gait(of_stiffness(wpi_srs(), ei), first.gait).speed_m_s) for ei in STIFFNESSES]
    assert first.name == "robust" and first.certificate is not None
    assert first.worst_speed_m_s == pytest.approx(min(speeds)) and min(speeds) > 0.47
    assert table["fast"].worst_speed_m_s < 0.2
    kept = default_table(nominal, "compliant")  # `plan` takes it without being told
    assert kept.gaits == table.for_planning().gaits and kept.changes is not None


def test_the_default_table_of_a_soft_robot_has_the_robust_gait(few):
    soft = wpi_srs().with_values(bending_stiffness_n_m2=0.002)
    table = default_table(soft, "compliant", driver=True)
    assert table.gaits[0].name == "robust" and table.gaits[0].worst_speed_m_s is None
    assert table.gaits[0].speed_m_s > 3 * table["fast"].speed_m_s
    assert [g.planned for g in table.gaits] == sorted((g.planned for g in table.gaits), reverse=True)
    unsure = soft.with_values(relative_sd={"bending_stiffness_n_m2": 0.2})
    assert soft.fingerprint() == unsure.fingerprint()
    worst = default_table(unsure, "compliant").gaits[0].worst_speed_m_s
    assert worst < table.gaits[0].speed_m_s  # at two deviations below it runs slower

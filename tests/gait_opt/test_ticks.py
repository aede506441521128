"""Gaits on coarse controller's ticks: optimized there, certified there."""

from dataclasses import replace

import pytest

from srs_opt.errors import InputError
from srs_opt.gait_opt.catalogue import shipped_table
from srs_opt.gait_opt.certificate import certify
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.finish import quantized
from srs_opt.gait_opt.goal import Goal, Limits, tick_counts
from srs_opt.gait_opt.switch_times import collocated_speeds
from srs_opt.gait_opt.ticks import Schedule
from srs_opt.robot import wpi_srs

ROBOT = wpi_srs()


def problem(tick_s: float, **wanted) -> CycleProblem:
    return CycleProblem((ROBOT,), "complex", Goal(**wanted), Limits(tick_s=tick_s))


# 20 ms: rounding gives 0.540, an exhaustive search of single ticks from outside found 0.5430 at 26 of them
@pytest.mark.parametrize(("tick_s", "least_m_s"), [(0.02, 0.5425), (0.03, 0.53), (0.05, 0.49)])
def test_the_fastest_gait_is_found_on_the_grid_and_certified_there(tick_s, least_m_s):
    asked = problem(tick_s)
    gait = quantized(asked, replace(shipped_table()["fast"].gait, pressure_kpa=41.0))
    assert Schedule.of_gait(gait, tick_s).period == round(gait.period_s / tick_s)
    certificate, _ = certify(asked, gait, collocated_speeds(asked, gait))
    assert certificate.passed, certificate.failures
    assert certificate.speed_m_s >= least_m_s


def test_a_wanted_radius_is_kept_on_the_grid():
    asked = problem(0.02, objective="turn", radius_m=0.314)
    gait = quantized(asked, replace(shipped_table()["fast R0.314 left"].gait, pressure_kpa=41.0))
    certificate, _ = certify(asked, gait, collocated_speeds(asked, gait))
    assert certificate.passed, certificate.failures
    assert certificate.speed_m_s > 0.45


def test_periods_are_counted_in_ticks_within_the_frequencies():
    assert tick_counts((1.0, 2.0), 0.02) == (25, 50)
    assert tick_counts((1.7, 1.7), 0.001) == (588, 589)  # 1.7007 and 1.6978 Hz
    with pytest.raises(InputError, match=r"nearest are 1\.923 and 2\.083 Hz"):
        Limits(frequency_hz=(1.95, 1.99), tick_s=0.04)

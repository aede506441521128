"""The optimizer against a theory value that knows nothing of it."""

import numpy as np
import pytest

from srs_opt.gait import Wave
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.continuation import Stage, run_stages
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.report import wave_parameters
from srs_opt.gait_opt.switch_times import optimize_switch_times
from srs_opt.robot import wpi_srs

PRESSURE_KPA = 10.0


@pytest.mark.parametrize("start_deg", [40, 70])
def test_small_viscous_waves_have_the_lag_of_theory(start_deg):
    """Five links, small amplitude, viscous friction: the fastest lag is 50.6 degrees.

    Theory assumes forces in proportion to speed, across the wheels much larger than along; small angles;
    no inertia; sinusoidal curvatures of equal size. To first order the wheels then move sideways such that
    sum y' = 0 and sum s y' = 0, and the speed goes with the integral of sum theta_i dy_i over a cycle: lags
    of 51.2, 49.5 and 51.2 degrees are best, 50.6 in the mean.

    Here friction is smoothed far above all speeds (viscous: tanh(v / v_s) is v / v_s) and so strong that
    motion stops within a hundredth of a cycle; segments bend by 3 degrees at most; slow actuators leave
    little of the valves' square wave but its first harmonic (a third one of a tenth would take 0.6 degrees
    off). The robot is ten times as large as the built-in one only to be fast enough for solver tolerances.
    """
    robot = wpi_srs().with_values(
        segment_length_m=0.37,
        gap_length_m=0.12,
        curvature_per_pressure_1_m_kpa=0.035,
        friction_normal=10.0,
        friction_tangential=0.5,
        friction_speed_m_s=1.0,
        gravity_m_s2=100.0,
        tau1_s=0.5,
        tau2_s=0.45,
    )
    limits = Limits((1.0, 1.0), (PRESSURE_KPA, PRESSURE_KPA))
    problem = CycleProblem((robot,), "complex", Goal(), limits)
    start = Wave.uniform(4, 1.0, PRESSURE_KPA, np.radians(start_deg)).gait()
    near = run_stages(problem, start, (Stage(robot.friction_speed_m_s, 60, 0.1, 6),)).gait
    found = optimize_switch_times(problem, near, 0.05)
    assert np.degrees(np.abs(found.orbits[0].kappa * robot.segment_length_m).max()) < 3
    known = wave_parameters(found.gait)
    assert known is not None
    lags = np.degrees(np.diff(np.unwrap(known[0])))
    assert lags.mean() == pytest.approx(50.6, abs=0.3)
    assert lags == pytest.approx([51.2, 49.5, 51.2], abs=0.5)

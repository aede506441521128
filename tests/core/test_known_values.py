"""Steady gaits that independent programs in other formulations found for the built-in robot."""

import math

import numpy as np
import pytest

from srs_opt.gait import Wave, published_wave
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs

# lag, kPa, Hz, offset, speed, turn rate, radius
COMPLEX = [
    (math.pi / 2, 41, 1, 0.0, 0.0787, 0.0, None),
    (math.pi / 2, 41, 2, 0.0, 0.2151, 0.0, None),
    (math.pi / 2, 55, 2, 0.0, 0.2315, 0.0, None),
    (math.pi / 2, 55, 2, 0.4, 0.2019, 0.817, 0.2473),
    (math.pi / 2, 55, 2, 0.7, 0.1951, 1.617, 0.1207),
    (math.pi / 2, 55, 1, 0.4, 0.0639, 0.273, 0.2340),
    (0.90, 41, 2, 0.0, 0.5440, 0.0, None),
    (0.90, 41, 2, 0.4, 0.5046, 1.510, 0.3341),
]
SIMPLIFIED = [
    (math.pi / 2, 41, 1, 0.0, 0.0833, None),
    (math.pi / 2, 41, 2, 0.0, 0.2265, None),
    (math.pi / 2, 55, 2, 0.0, 0.2451, None),
    (math.pi / 2, 55, 2, 0.4, 0.199, 0.254),
    (0.90, 41, 2, 0.0, 0.583, None),
]


@pytest.mark.parametrize("row", COMPLEX)
def test_complex(row):
    lag, kpa, hertz, offset, speed, turn_rate, radius = row
    found = steady_gait(wpi_srs(), Wave.uniform(4, hertz, kpa, lag, offset).gait())
    assert found.speed_m_s == pytest.approx(speed, rel=0.01)
    assert found.turn_rate_rad_s == pytest.approx(turn_rate, rel=0.01, abs=1e-3)
    if radius is None:
        assert found.radius_m is None
    else:
        assert found.radius_m == pytest.approx(radius, rel=0.01)
        assert found.speed_m_s == pytest.approx(found.turn_rate_rad_s * found.radius_m, rel=1e-9)


@pytest.mark.parametrize("row", SIMPLIFIED)
def test_simplified(row):
    lag, kpa, hertz, offset, speed, radius = row
    found = steady_gait(wpi_srs(), Wave.uniform(4, hertz, kpa, lag, offset).gait(), "simplified")
    assert found.speed_m_s == pytest.approx(speed, rel=0.01)
    assert (found.radius_m is None) if radius is None else found.radius_m == pytest.approx(radius, rel=0.01)


def test_cone_law_is_another_physics():
    robot = wpi_srs().with_values(friction_law="cone")
    assert steady_gait(robot, published_wave(robot).gait()).speed_m_s == pytest.approx(0.12, abs=0.005)


def test_smoothing_speed_converges_to_the_stated_limits():
    """v_s 0.002 -> 0.0003: radius 0.234 -> 0.241 m, and 0.544 -> 0.547 m/s at lag 0.90."""
    sharp = wpi_srs().with_values(friction_speed_m_s=0.0003)
    turning = steady_gait(sharp, Wave.uniform(4, 1, 55, math.pi / 2, 0.4).gait())
    assert turning.radius_m == pytest.approx(0.241, rel=0.005)
    fast = steady_gait(sharp, Wave.uniform(4, 2, 41, 0.90).gait())
    assert fast.speed_m_s == pytest.approx(0.547, rel=0.003)


def test_order_of_convergence_in_the_smoothing_speed():
    """The steady speed approaches dry friction's at an order near 1 (it is a perturbation of sgn by v_s)."""
    gait = Wave.uniform(4, 2, 41, 0.90).gait()
    sizes = np.array([0.008, 0.004, 0.002, 0.001, 0.0005])
    speeds = np.array(
        [
            steady_gait(wpi_srs().with_values(friction_speed_m_s=v), gait, tolerance=3e-6).speed_m_s
            for v in sizes
        ]
    )
    steps = np.abs(np.diff(speeds))
    orders = np.log2(steps[:-1] / steps[1:])
    assert (orders > 0.7).all(), (speeds, orders)
    assert (orders < 2.5).all(), (speeds, orders)


def test_fastest_known_wave():
    phases = tuple(np.cumsum([0.0, 0.97, 0.79, 0.82]))
    found = steady_gait(wpi_srs(), Wave(1.88, 41.5, phases, (0.0,) * 4).gait())
    assert found.speed_m_s == pytest.approx(0.547, rel=0.01)

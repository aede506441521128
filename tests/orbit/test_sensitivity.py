"""Derivatives of steady gaits against finite differences of whole solutions."""

import math
from dataclasses import replace

import numpy as np
import pytest

from srs_opt.gait import Gait, Wave
from srs_opt.orbit.sensitivity import sensitivity
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs

TOLERANCE = 1e-8
WAVES = {
    "straight": Wave.uniform(4, 1.6, 48.0, 1.1),
    "turning, switches together": Wave.uniform(4, 2.0, 50.0, math.pi / 2, 0.4),
    "free": Wave(1.7, 48.0, (0.1, 1.1, 1.9, 3.1), (0.3, -0.1, 0.2, 0.4)),
}


def motion(robot, gait, model="complex"):
    orbit = steady_gait(robot, gait, model, tolerance=TOLERANCE)
    return np.array([orbit.speed_m_s, orbit.turn_rate_rad_s])


def close(found, ends, step, scale):
    difference = (ends[0] - ends[1]) / (2 * step)
    np.testing.assert_allclose(found * scale, difference * scale, rtol=5e-3, atol=2e-4)


@pytest.mark.parametrize("name", WAVES)
def test_gait_parameters(name):
    robot, wave = wpi_srs(), WAVES[name]
    found = sensitivity(robot, steady_gait(robot, wave.gait(), tolerance=TOLERANCE)).of_wave(wave)
    for key in ("frequency_hz", "pressure_kpa"):
        step = 1e-3 * getattr(wave, key)
        ends = [motion(robot, replace(wave, **{key: getattr(wave, key) + s}).gait()) for s in (step, -step)]
        close(found[key], ends, step, getattr(wave, key))
    for key in ("phase_rad", "offset"):
        for i in (0, 2):
            ends = []
            for s in (1e-3, -1e-3):
                values = list(getattr(wave, key))
                values[i] += s
                ends.append(motion(robot, replace(wave, **{key: tuple(values)}).gait()))
            close(found[key][i], ends, 1e-3, 1.0)


@pytest.mark.parametrize("model", ["complex", "simplified"])
def test_robot_parameters(model):
    robot, gait = wpi_srs(), WAVES["free"].gait()
    found = sensitivity(robot, steady_gait(robot, gait, model, tolerance=TOLERANCE), model).robot
    for key in ("friction_normal", "friction_tangential", "tau1_s", "gap_length_m", "link_mass_kg"):
        step = 1e-3 * getattr(robot, key)
        ends = [
            motion(robot.with_values(**{key: getattr(robot, key) + s}), gait, model) for s in (step, -step)
        ]
        close(found[key], ends, step, getattr(robot, key))


def test_single_switches_of_a_gait_that_is_no_wave():
    pairs = (((0.0, 0.3), (0.4, 0.6)), ((0.7, 0.2),), ((0.55, 0.05), (0.2, 0.3)), ((0.35, 0.7),))
    robot, gait = wpi_srs(), Gait(0.8, 50.0, pairs)
    found = sensitivity(robot, steady_gait(robot, gait, tolerance=TOLERANCE)).switches
    assert [len(s) for s in found] == [2, 1, 2, 1]
    for segment, interval, edge in ((0, 1, 0), (1, 0, 1), (2, 0, 1), (3, 0, 0)):
        ends = []
        for s in (2e-4, -2e-4):
            moved = [[list(pair) for pair in own] for own in pairs]
            moved[segment][interval][edge] += s
            ends.append(
                motion(robot, replace(gait, intervals=tuple(tuple(map(tuple, own)) for own in moved)))
            )
        close(found[segment][interval][edge], ends, 2e-4, 0.1)

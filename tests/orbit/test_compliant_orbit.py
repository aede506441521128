"""Steady gaits of soft bodies: reached from rest, closed, with exact derivatives."""

import math
from dataclasses import replace

import numpy as np
import pytest

from srs_opt.gait import Wave
from srs_opt.orbit.attractors import other_orbits
from srs_opt.orbit.period_map import tangent_kernel
from srs_opt.orbit.sensitivity import sensitivity
from srs_opt.orbit.steady import steady_gait, steady_gaits
from srs_opt.robot import wpi_srs
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.kernel import Course
from srs_opt.simulate.run import motion_of_cycle
from srs_opt.simulate.timeline import Timeline

TOLERANCE = 1e-7


def soft(stiffness, **changes):
    return wpi_srs().with_values(bending_stiffness_n_m2=stiffness, friction_speed_m_s=0.001, **changes)


def waves():
    return {
        "straight": Wave(2.0, 41.0, tuple(np.cumsum([0.0, 1.1, 1.08, 0.67])), (0.0,) * 4),
        "turning": Wave.uniform(4, 2.0, 55.0, math.pi / 2, 0.4),
        "free": Wave(1.7, 48.0, (0.1, 1.1, 1.9, 3.1), (0.3, -0.1, 0.2, 0.4)),
    }


@pytest.mark.parametrize("name", waves())
@pytest.mark.parametrize("stiffness", [0.02, 0.005, 0.002])
def test_the_orbit_is_where_a_standing_start_ends(name, stiffness):
    robot, gait = soft(stiffness), waves()[name].gait()
    orbit = steady_gait(robot, gait)
    run = Integrator(robot)
    path = run.integrate(Timeline.of_gait(gait, 60 * gait.period_s), run.rest())
    last = motion_of_cycle(run, path, gait, 59)
    assert orbit.speed_m_s == pytest.approx(last.speed_m_s, rel=2e-3)
    assert orbit.turn_rate_rad_s == pytest.approx(last.turn_rate_rad_s, rel=2e-3, abs=1e-3)
    assert orbit.largest_multiplier < 1
    assert orbit.solution.residual_m_s < 1e-8
    assert orbit.dynamic.shape == (11,)


def test_a_known_gait_for_soft_bodies():
    """An independent optimization names lags 1.10, 1.08, 0.67 as the best at 0.005 N m^2, with 0.519 m/s."""
    assert steady_gait(soft(0.005), waves()["straight"].gait()).speed_m_s == pytest.approx(0.519, rel=0.005)


def test_relaxation_matters_as_an_independent_program_says():
    """The less the material damps, the slower (another gait of that program: 0.375, 0.415, 0.533 m/s)."""
    gait = Wave.uniform(4, 2.0, 41.0, 0.9).gait()
    speeds = [steady_gait(soft(0.005, bending_relaxation_s=t), gait).speed_m_s for t in (0.001, 0.005, 0.05)]
    assert speeds == sorted(speeds)
    assert speeds[2] > 1.15 * speeds[1]


def test_multipliers_are_those_of_exact_tangents():
    robot, gait = soft(0.003), waves()["straight"].gait()
    orbit = steady_gait(robot, gait)
    run, s = Integrator(robot), orbit.solution
    p = run.pack(gait.pressure_kpa, gait.frequency_hz)
    dynamic, kernel = run.layout.dynamic, tangent_kernel(run.structure)
    inputs = np.column_stack([s.valve.T[s.mesh.phase], np.zeros(s.mesh.h_s.size)])
    still = np.concatenate([p, np.zeros(p.size)])
    columns = []
    for i in dynamic:
        course = Course(np.concatenate([s.start, np.eye(run.states)[i]]), s.mesh.h_s, inputs, still)
        columns.append(kernel.run([course])[0][-1, run.states :, 0][dynamic])
    expected = sorted(abs(np.linalg.eigvals(np.array(columns).T)), reverse=True)
    np.testing.assert_allclose(abs(orbit.multipliers), expected, rtol=1e-4, atol=1e-6)


def motion(robot, gait, guess):
    orbit = steady_gait(robot, gait, tolerance=TOLERANCE, guess=guess)
    return np.array([orbit.speed_m_s, orbit.turn_rate_rad_s])


def test_derivatives_are_those_of_finite_differences():
    robot, wave = soft(0.005), waves()["free"]
    orbit = steady_gait(robot, wave.gait(), tolerance=TOLERANCE)
    found = sensitivity(robot, orbit)
    by_wave = found.of_wave(wave)
    pairs = []
    for key in ("frequency_hz", "pressure_kpa"):
        value = getattr(wave, key)
        ends = [
            motion(robot, replace(wave, **{key: value * f}).gait(), orbit.dynamic) for f in (1.001, 0.999)
        ]
        pairs.append((by_wave[key] * value, (ends[0] - ends[1]) / 2e-3))
    phases = np.array(wave.phase_rad)
    ends = [
        motion(robot, replace(wave, phase_rad=tuple(phases + d * np.eye(4)[2])).gait(), orbit.dynamic)
        for d in (1e-3, -1e-3)
    ]
    pairs.append((by_wave["phase_rad"][2], (ends[0] - ends[1]) / 2e-3))
    for key in ("bending_stiffness_n_m2", "bending_relaxation_s", "friction_normal", "tau1_s"):
        value = getattr(robot, key)
        ends = [
            motion(robot.with_values(**{key: value * f}), wave.gait(), orbit.dynamic) for f in (1.001, 0.999)
        ]
        pairs.append((found.robot[key] * value, (ends[0] - ends[1]) / 2e-3))
    for exact, difference in pairs:
        np.testing.assert_allclose(exact, difference, rtol=5e-3, atol=5e-4)


def test_stiff_bodies_have_the_rigid_orbit():
    gait = waves()["turning"].gait()
    rigid = steady_gait(soft(0.005), gait, "complex")
    stiff = steady_gait(soft(50.0), gait)
    assert stiff.speed_m_s == pytest.approx(rigid.speed_m_s, rel=1e-3)
    assert stiff.radius_m == pytest.approx(rigid.radius_m, rel=1e-3)
    np.testing.assert_allclose(stiff.dynamic[:2], rigid.velocity[:2], atol=1e-3)


def test_rolling_starts_can_find_another_stable_orbit():
    gait = Wave(1.923, 51.28, tuple(np.cumsum([0.0, 1.222, 0.917, 0.758])), (0.0,) * 4).gait()
    robot = soft(0.002)
    orbit = steady_gait(robot, gait)
    assert orbit.speed_m_s == pytest.approx(0.366, rel=0.01)
    (other,) = other_orbits(robot, orbit)
    assert other.speed_m_s == pytest.approx(0.475, rel=0.01)
    assert other.largest_multiplier < 1
    stiffer = soft(0.01)
    assert other_orbits(stiffer, steady_gait(stiffer, gait)) == []
    assert other_orbits(wpi_srs(), steady_gait(wpi_srs(), gait)) == []


def test_many_at_once_are_the_same():
    robot = soft(0.005)
    gaits = [wave.gait() for wave in waves().values()]
    for one, many in zip((steady_gait(robot, g) for g in gaits), steady_gaits(robot, gaits)):
        assert one.speed_m_s == many.speed_m_s

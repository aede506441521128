"""The laboratory's mechanics against closed forms, conservation laws and a second formulation."""

import dataclasses
import math

import numpy as np
import pytest

from virtual_lab import kernel
from virtual_lab.assemble import assemble
from virtual_lab.maps import steady_motion
from virtual_lab.simulate import look, run, sample
from virtual_lab.trials import Schedule, Trial
from virtual_lab.truth import Parameters, Truth
from virtual_lab.valves import wave_switches

COARSE = Truth(friction_speed_m_s=0.002)
GAIT = Trial("t", 2.0, 55.0, 0.4)
STILL = Trial("s", 1.0, 0.0, kind="still")


def gap_between(a, b):
    return float(np.max(np.hypot(a.x - b.x, a.y - b.y)))


@pytest.mark.parametrize(
    ("lag", "pressure", "frequency", "offset", "speed", "rate", "radius"),
    [
        (math.pi / 2, 41, 1, 0.0, 0.0787, 0, None),
        (math.pi / 2, 41, 2, 0.0, 0.2151, 0, None),
        (math.pi / 2, 55, 2, 0.0, 0.2315, 0, None),
        (math.pi / 2, 55, 2, 0.4, 0.2019, 0.817, 0.2473),
        (math.pi / 2, 55, 2, 0.7, 0.1951, 1.617, 0.1207),
        (math.pi / 2, 55, 1, 0.4, 0.0639, 0.273, 0.2340),
        (0.90, 41, 2, 0.0, 0.5440, 0, None),
        (0.90, 41, 2, 0.4, 0.5046, 1.510, 0.3341),
    ],
)
def test_steady_gaits_known_from_other_programs(lag, pressure, frequency, offset, speed, rate, radius):
    trial = Trial("t", frequency, pressure, offset, phase_lag_rad=lag)
    motion = steady_motion(COARSE, trial, settle_s=8.0, cycles=1)
    assert motion.speed_m_s == pytest.approx(speed, rel=0.005)
    assert motion.turn_rate_rad_s == pytest.approx(rate, rel=0.005, abs=1e-3)
    if radius is None:
        assert motion.radius_m is None
    else:
        assert motion.radius_m == pytest.approx(radius, rel=0.005)


def chain_gap(q, kappa, p):
    """Return the position and heading errors of joined links; the paper's (3) with the gap in halves."""
    x, y, th = q.reshape(3, -1)
    turn = p.segment_length_m * kappa
    arc = p.segment_length_m * np.sinc(turn / 2 / np.pi)
    half, mid = p.gap_length_m / 2, (th[:-1] + th[1:]) / 2
    dx = half * (np.cos(th[:-1]) + np.cos(th[1:])) + arc * np.cos(mid)
    dy = half * (np.sin(th[:-1]) + np.sin(th[1:])) + arc * np.sin(mid)
    return np.concatenate([np.diff(x) - dx, np.diff(y) - dy, np.diff(th) - turn])


@pytest.mark.parametrize("links", [3, 5, 12])
def test_accelerations_match_free_links_with_multipliers(links):
    """All links free in the plane, joined by Lagrange multipliers: no partial velocities, no recursion."""
    rng = np.random.default_rng(links)
    p = Parameters(links=links, link_inertia_kg_m2=2e-5)
    tables = assemble(Truth(p, friction_speed_m_s=0.05), STILL, 1.0)
    tables.links[:, kernel.MASS] *= rng.uniform(0.5, 2.0, links)
    shape = np.column_stack([rng.normal(0, s, links - 1) for s in (10.0, 50.0, 0.0, 500.0)])
    state = rng.normal(0, [1, 1, 2, 0.2, 0.2, 1.0])
    chain, rates = np.zeros((links, kernel.CHAIN_COLUMNS)), np.zeros(6)
    lengths = np.zeros((links - 1, 3))
    kernel.set_lengths(shape, tables.lengths, 0.0, lengths)
    kernel.set_chain(shape, lengths, tables.ground, chain)
    kernel.body_rates(state, chain, tables.links, tables.ground, rates)

    def pose(t):
        k = shape[:, 0] + shape[:, 1] * t + shape[:, 3] * t * t / 2
        row = np.concatenate([state[:3] + state[3:] * t, np.zeros(3), k, 0 * k])
        r = look(tables, row[None], np.zeros(1))
        return np.concatenate([r.x[0], r.y[0], r.theta[0]])

    h = 1e-4
    q = pose(0.0)
    v = (8 * (pose(h) - pose(-h)) - (pose(2 * h) - pose(-2 * h))) / (12 * h)
    vx, vy, _ = v.reshape(3, -1)
    th = q[2 * links :]
    vt, vn = vx * np.cos(th) + vy * np.sin(th), vy * np.cos(th) - vx * np.sin(th)
    load = tables.links[:, kernel.LOAD]
    ft, fn = -load * 0.043 * np.tanh(vt / 0.05), -load * 0.57 * np.tanh(vn / 0.05)
    force = np.concatenate([ft * np.cos(th) - fn * np.sin(th), ft * np.sin(th) + fn * np.cos(th), 0 * th])
    mass = np.concatenate([tables.links[:, kernel.MASS]] * 2 + [np.full(links, p.link_inertia_kg_m2)])

    def drift(t):
        k = shape[:, 0] + shape[:, 1] * t + shape[:, 3] * t * t / 2
        return chain_gap(q + v * t, k, p)

    jacobian = np.stack(
        [
            (chain_gap(q + 1e-6 * e, shape[:, 0], p) - chain_gap(q - 1e-6 * e, shape[:, 0], p)) / 2e-6
            for e in np.eye(3 * links)
        ],
        axis=1,
    )
    second = (drift(h) - 2 * drift(0.0) + drift(-h)) / h**2
    system = np.block([[np.diag(mass), -jacobian.T], [jacobian, np.zeros((len(second), len(second)))]])
    answer = np.linalg.solve(system, np.concatenate([force, -second]))
    np.testing.assert_allclose(rates[3:], answer[[0, links, 2 * links]], rtol=2e-4, atol=2e-4)


def test_converges_in_the_step():
    times = np.linspace(0, 2, 41)
    fine = run(COARSE, GAIT, times, refine=16)
    errors = [gap_between(run(COARSE, GAIT, times, refine=r), fine) for r in (1, 2, 4)]
    assert errors[0] < 2e-5
    assert errors[1] < errors[0] / 6
    assert errors[2] < errors[1] / 6


def test_default_step_is_far_below_the_noise():
    times = np.linspace(0, 4, 41)
    assert gap_between(run(Truth(), GAIT, times), run(Truth(), GAIT, times, refine=4)) < 2e-5


def test_finer_friction_converges():
    runs = [run(Truth(friction_speed_m_s=v), GAIT, np.array([3.0])) for v in (0.0006, 0.0003, 0.00015)]
    assert gap_between(runs[1], runs[2]) < gap_between(runs[0], runs[1]) < 0.01


def kinetic(tables, samples):
    """Kinetic energy from differences of the links' places in neighbouring samples."""
    r = look(tables, samples, samples[:, 0])
    dt = 1e-3
    m, j = tables.links[:, kernel.MASS], tables.links[:, kernel.INERTIA]
    squares = np.diff(r.x, axis=0) ** 2 + np.diff(r.y, axis=0) ** 2
    return (squares @ m + np.diff(r.theta, axis=0) ** 2 @ j) / (2 * dt * dt)


@pytest.mark.parametrize("law", ["per_axis", "cone"])
@pytest.mark.parametrize("bend", [0.0, 12.0])
def test_energy_only_falls_when_the_shape_is_locked(law, bend):
    truth = Truth(
        Parameters(friction_law=law),
        effects=({"name": "tether_drag", "force_n": 0.03}, {"name": "wheel_toe", "angle": 0.1}),
    )
    tables = assemble(truth, STILL, 4.0)
    tables.bias[:] = bend
    shape = np.zeros((4, 4))
    shape[:, 0] = bend
    samples = sample(tables, np.array([0, 0, 0.3, 0.8, 0.4, 3.0]), shape, np.arange(0, 4, 1e-3))
    energy = kinetic(tables, samples)
    assert np.all(np.diff(energy) <= 1e-9)
    assert energy[0] > 0.02
    assert energy[-1] < 1e-6


def test_momentum_is_kept_without_friction():
    truth = Truth(Parameters(friction_tangential=0.0, friction_normal=0.0), friction_speed_m_s=1.0)
    r = run(truth, GAIT, np.arange(0, 1, 1e-3))
    centre = r.centre_of_mass()
    assert np.ptp(centre, axis=0) == pytest.approx([0, 0], abs=1e-10)
    dx, dy = np.diff(r.x, axis=0), np.diff(r.y, axis=0)
    mx, my = (r.x[1:] + r.x[:-1]) / 2 - centre[0, 0], (r.y[1:] + r.y[:-1]) / 2 - centre[0, 1]
    spin = ((mx * dy - my * dx) @ r.mass + np.diff(r.theta, axis=0).sum(axis=1) * 1e-6) / 1e-3
    assert np.max(np.abs(spin)) < 1e-6
    assert np.max(np.abs(np.diff(r.theta, axis=0))) > 1e-3


def test_straight_slide_has_the_textbook_length():
    """Coasting along the wheels from speed v stops after v^2/(2 mu g)."""
    tables = assemble(Truth(friction_speed_m_s=1e-4), STILL, 2.0)
    samples = sample(tables, np.array([0, 0, 0, 0.5, 0, 0.0]), np.zeros((4, 4)), np.array([1.9]))
    assert samples[0, 0] == pytest.approx(0.25 / (2 * 0.043 * 9.81), rel=1e-3)
    assert abs(samples[0, 1]) < 1e-12


def test_mirror_image():
    times = np.linspace(0, 3, 31)
    schedule = Schedule(tuple((s, 0.1 * s, 0.1 * s + 0.3) for s in range(1, 5)), 0.5)
    mirrored = Schedule(tuple((s, off, on + 0.5) for s, on, off in schedule.entries), 0.5)
    left = run(Truth(), dataclasses.replace(GAIT, schedule=schedule), times)
    right = run(Truth(), dataclasses.replace(GAIT, schedule=mirrored), times)
    np.testing.assert_allclose(left.x, right.x, atol=1e-9)
    np.testing.assert_allclose(left.y, -right.y, atol=1e-9)
    assert np.ptp(left.y) > 0.05


def test_turning_the_frame_turns_the_track():
    times = np.linspace(0, 3, 31)
    a, b = run(Truth(), GAIT, times), run(Truth(), dataclasses.replace(GAIT, heading_rad=1.1), times)
    c, s = math.cos(1.1), math.sin(1.1)
    np.testing.assert_allclose(c * a.x - s * a.y, b.x, atol=1e-9)
    np.testing.assert_allclose(s * a.x + c * a.y, b.y, atol=1e-9)


def test_starts_straight_and_lies_still_before():
    r = run(Truth(), dataclasses.replace(GAIT, heading_rad=0.5), np.array([-0.5, 0.0]))
    along = 0.049 * np.arange(5)
    np.testing.assert_allclose(r.x, [along * math.cos(0.5)] * 2, atol=1e-12)
    np.testing.assert_allclose(r.y, [along * math.sin(0.5)] * 2, atol=1e-12)
    assert np.all(r.kappa == 0)
    assert np.all(r.kappa_rate == 0)


def test_curvature_follows_the_step_response():
    times = np.linspace(0, 0.9, 91)
    trial = Trial("s", 1.0, 50.0, schedule=Schedule(((2, 0.0, 5.0),), 5.0))
    kappa = run(Truth(), trial, times).kappa
    expected = 17.5 * (1 - (0.08 * np.exp(-times / 0.08) - 0.05 * np.exp(-times / 0.05)) / 0.03)
    np.testing.assert_allclose(kappa[:, 1], expected, atol=1e-6)
    assert np.all(kappa[:, [0, 2, 3]] == 0)


@pytest.mark.parametrize("lag", [0.0, 0.9, math.pi / 2, math.pi, 5.0, -2.0])
@pytest.mark.parametrize("offset", [-1.2, -0.4, 0.0, 0.7])
def test_switches_are_those_of_the_wave(lag, offset):
    switches = wave_switches(1.7, lag, offset, 3.0)
    when, value = zip(*switches)
    times = np.linspace(1e-4, 2.9999, 3001)
    wave = np.sin(2 * np.pi * 1.7 * times + lag) + offset
    sure = np.abs(wave) > 1e-6
    found = np.array(value)[np.searchsorted(when, times, side="right") - 1]
    np.testing.assert_array_equal(found[sure], np.sign(wave)[sure])

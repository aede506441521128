"""The compliant model against another derivation, conservation laws, symmetries and limits."""

import dataclasses
import json
import math
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

sys.path.insert(0, str(Path(__file__).parents[1] / "core"))
import oracle_snake as oracle
from oracle_snake import BODY, GROUND, ROOM

from srs_opt.errors import InputError
from srs_opt.gait import Wave
from srs_opt.model.bending_chain import BendingChain
from srs_opt.model.chain_derivatives import derivatives
from srs_opt.model.chambers import Drive
from srs_opt.model.inverse import inverse_dynamics
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.robot import wpi_srs
from srs_opt.simulate.__main__ import main
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.run import motion_of_cycle
from srs_opt.simulate.timeline import Timeline

CASES = [(3, []), (5, []), (5, BODY + GROUND + ROOM), (8, GROUND), (12, BODY)]
RELAXATION_S = 0.005


def soft(stiffness, **changes):
    return wpi_srs().with_values(bending_stiffness_n_m2=stiffness, **changes)


def wave(frequency=2.0, pressure=55.0, lag=math.pi / 2, offset=0.0):
    return Wave.uniform(4, frequency, pressure, lag, offset).gait()


def oracle_acceleration(robot, function, s, no_load, no_load_rate):
    """Second derivatives of (tail, heading, kappa) from the Lagrangian in tail coordinates."""
    body = oracle.Body.of(robot)
    flexibility = 1 / robot.bending_stiffness_n_m2
    if robot.gap_stiffness_n_m2:
        flexibility += body.gap / (body.l * robot.gap_stiffness_n_m2)
    lag = no_load - s.kappa + robot.bending_relaxation_s * (no_load_rate - s.dkappa)
    q = np.concatenate([[s.tail.real, s.tail.imag, s.heading], s.kappa])
    dq = np.concatenate([[s.tail_rate.real, s.tail_rate.imag, s.heading_rate], s.dkappa])
    lengths = [body.l, body.gap, body.ratio, body.inertia]
    f = oracle.external_forces(robot, s)
    jac = np.asarray(function(q, dq, 0, lengths, body.mass)[2])
    force = jac.T @ np.stack([f.real, f.imag], axis=1).ravel()
    force[3:] += body.l * lag / flexibility
    matrix, right = (np.asarray(v) for v in function(q, dq, force, lengths, body.mass)[:2])
    return np.linalg.solve(matrix, right.ravel())


@pytest.mark.parametrize(("links", "effects"), CASES)
def test_equations_agree_with_a_lagrangian_in_other_coordinates(links, effects):
    robot = soft(0.004, gap_stiffness_n_m2=0.02, links=links, effects=effects, link_inertia_kg_m2=2e-5)
    structure = Structure.of(robot)
    parameters, model, _ = build(structure)
    chain = BendingChain(model)
    y, dy, ddy = (ca.SX.sym(name, chain.size) for name in ("y", "dy", "ddy"))
    still = ca.SX.zeros(links - 1, 1)  # accelerations matter only where chambers lengthen
    drive = Drive(ca.SX.sym("k", links - 1), ca.SX.sym("dk", links - 1), ca.SX.sym("frame", 3), still)
    g, power = chain.residual(y, dy, ddy, drive, ca.SX(1))
    d = derivatives(chain, y, dy, ddy, drive)
    ours = [d.mass.dense(), d.by_rate.dense(), d.by_place.dense(), d.power_by_rate, d.power_by_place]
    direct = [-ca.jacobian(g, ddy), ca.jacobian(g, dy), ca.jacobian(g, y)]
    direct += [ca.jacobian(power, dy), ca.jacobian(power, y)]
    inputs = [y, dy, ddy, drive.no_load, drive.no_load_rate, drive.frame, parameters.vector]
    f = ca.Function("f", inputs, [g, *ours, *direct])
    function, rng = oracle.lagrangian(links), np.random.default_rng(links)
    frame, turned = np.array([0.3, -0.2, 0.7]), np.exp(-0.7j)
    per_kappa = oracle.Body.of(robot).turn

    def coordinates(tail, heading, kappa):
        headings = heading + np.concatenate([[0], np.cumsum(per_kappa * kappa)])
        return np.concatenate([[(tail * turned).real, (tail * turned).imag], headings])

    for _ in range(3):
        s = oracle.random_state(rng, links)
        no_load = s.kappa + rng.normal(size=links - 1)
        no_load_rate = rng.normal(size=links - 1) * 50
        a = oracle_acceleration(robot, function, s, no_load, no_load_rate)
        at = coordinates(s.tail - complex(*frame[:2]), s.heading - frame[2], s.kappa)
        rate = coordinates(s.tail_rate, s.heading_rate, s.dkappa)
        acceleration = coordinates(complex(*a[:2]), a[2], a[3:])
        p = parameters.pack(robot, 50, 1)
        residual, *matrices = (
            np.asarray(v) for v in f(at, rate, acceleration, no_load, no_load_rate, frame, p)
        )
        assert np.abs(residual).max() < 1e-12 * np.abs(matrices[0] @ acceleration).max()
        for own, exact in zip(matrices[:5], matrices[5:]):
            np.testing.assert_allclose(own, exact, rtol=1e-9, atol=1e-12 * np.abs(exact).max())


def _start(run, s):
    """A state of the integrator with the bends of an oracle's state, the actuators at rest."""
    x = run.rest()
    pose, u, spin = oracle.body_state(run.robot, s)
    x[:3], x[3:5], x[5] = pose, u[:2], spin
    x[run.layout.kappa], x[run.layout.dkappa] = s.kappa, s.dkappa
    return x


@pytest.mark.parametrize("effects", [[], BODY + GROUND + ROOM])
def test_motion_agrees_with_the_lagrangian_integrated_by_scipy(effects):
    robot = soft(0.005, effects=effects, friction_speed_m_s=0.05)
    run, valve, end = Integrator(robot), np.array([1.0, -1.0, 1.0, -1.0]), 0.06
    s = oracle.random_state(np.random.default_rng(1), 5)
    s = dataclasses.replace(s, kappa=12.0 * valve)  # the oracle's chords are inaccurate near zero
    p, function = run.pack(55.0, 2.0), oracle.lagrangian(5)
    amplitude, a, b = 55.0 * 0.35, robot.tau1_s, robot.tau2_s

    def no_load(t):
        one = 1 - (a * math.exp(-t / a) - b * math.exp(-t / b)) / (a - b)
        return amplitude * valve * one, amplitude * valve * (math.exp(-t / a) - math.exp(-t / b)) / (a - b)

    def rates(t, z):
        q, dq = z[:7], z[7:]
        state = oracle.State(complex(*q[:2]), q[2], q[3:], complex(*dq[:2]), dq[2], dq[3:])
        return np.concatenate([dq, oracle_acceleration(robot, function, state, *no_load(t))])

    first = np.r_[s.tail.real, s.tail.imag, s.heading, s.kappa]
    first = np.r_[first, s.tail_rate.real, s.tail_rate.imag, s.heading_rate, s.dkappa]
    exact = solve_ivp(rates, (0, end), first, method="LSODA", rtol=1e-10, atol=1e-11).y[:, -1]
    last = oracle.State(
        complex(*exact[:2]), exact[2], exact[3:7], complex(*exact[7:9]), exact[9], exact[10:14]
    )
    wanted = _start(run, last)
    x = run.steps(_start(run, s), Mesh.uniform(np.array([end]), 0.00025), valve[:, None], p)[0][:, -1]
    layout = run.layout
    np.testing.assert_allclose(x[:3], wanted[:3], atol=1e-8)
    np.testing.assert_allclose(x[3:5], wanted[3:5], atol=1e-6)
    np.testing.assert_allclose(x[layout.kappa], wanted[layout.kappa], atol=1e-5)
    np.testing.assert_allclose(x[layout.dkappa], wanted[layout.dkappa], atol=1e-3)


def test_order_of_the_integration_is_four():
    run = Integrator(soft(0.005, friction_speed_m_s=0.3, effects=BODY + GROUND + ROOM))
    s, p = oracle.random_state(np.random.default_rng(1), 5), run.pack(55.0, 2.0)
    valve = np.array([[1.0], [-1.0], [1.0], [-1.0]])
    ends = [
        run.steps(_start(run, s), Mesh.uniform(np.array([0.06]), step), valve, p)[0][
            : run.layout.dkappa.stop, -1
        ]
        for step in (0.001, 0.0005, 0.00025, 0.00003125)
    ]
    errors = np.abs(np.array(ends[:-1]) - ends[-1])
    orders = np.log2(errors[:-1] / errors[1:])
    assert (np.median(orders, axis=1) > 3.8).all(), orders


def test_energy_balance_closes():
    """Pressure's work in; friction and material out; the rest is stored, in springs and motion."""
    robot = soft(0.005)
    run = Integrator(robot)
    path = run.integrate(Timeline.of_gait(wave(offset=0.3), 1.7), run.rest(), 1e-8)
    parameters, m, _ = build(run.structure)
    velocity = ca.SX.sym("velocity", 3)
    outputs = [
        m.pressure_power(),
        m.material_loss(),
        m.elastic_energy() + m.kinetic_energy(velocity),
    ]
    f = ca.Function("f", [m.kappa, m.dkappa, m.no_load, m.no_load_rate, velocity, parameters.vector], outputs)
    p = run.pack(55.0, 2.0)
    columns = (path.kappa.T, path.dkappa.T, path.no_load.T, path.no_load_rate.T, path.velocity.T)
    power, loss, stored = (np.asarray(v).ravel() for v in f(*columns, p))
    paid, lost = (_integral(path.time_s, y) for y in (power, loss))
    assert paid == pytest.approx(lost + path.work_j[-1] + stored[-1], rel=2e-5)
    assert lost > 0.02 * paid
    assert path.work_j[-1] > 0.5 * paid


def _integral(t, y):
    """Integrate by cubic splines (the integrand's kinks at switches are weak: its slope is continuous)."""
    return float(CubicSpline(t, y).integrate(t[0], t[-1]))


def test_energy_only_falls_without_pressure():
    run = Integrator(soft(0.005))
    _, m, _ = build(run.structure)
    velocity = ca.SX.sym("velocity", 3)
    energy = ca.Function(
        "e",
        [m.kappa, m.no_load, velocity, m.dkappa, m.parameters.vector],
        [m.elastic_energy() + m.kinetic_energy(velocity)],
    )
    s = oracle.random_state(np.random.default_rng(3), 5)
    path = run.integrate(Timeline.vent(4, 1.0, 50.0), _start(run, s))
    e = energy(path.kappa.T, path.no_load.T, path.velocity.T, path.dkappa.T, run.pack(50.0, 1.0))
    e = np.asarray(e).ravel()
    assert (np.diff(e) <= 1e-7 * e[0]).all()
    assert e[-1] < 0.2 * e[0]  # what dry friction holds stays in the springs


def test_moving_and_turning_the_frame_changes_nothing():
    run, timeline = Integrator(soft(0.005)), Timeline.of_gait(wave(offset=0.4), 2.0)
    here, there = (run.integrate(timeline, run.rest(*place)) for place in ((), (3.0, -2.0, 1.1)))
    c, s = math.cos(1.1), math.sin(1.1)
    x, y, heading = here.pose.T
    np.testing.assert_allclose(there.pose[:, 0], 3 + c * x - s * y, atol=1e-10)
    np.testing.assert_allclose(there.pose[:, 1], -2 + s * x + c * y, atol=1e-10)
    np.testing.assert_allclose(there.pose[:, 2], heading + 1.1, atol=1e-10)


def test_mirrored_valves_mirror_the_motion():
    run = Integrator(soft(0.003))
    timeline = Timeline.of_gait(wave(offset=0.4), 2.0)
    other = Timeline(timeline.duration_s, -timeline.valve, timeline.pressure_kpa, timeline.frequency_hz)
    here, there = run.integrate(timeline, run.rest()), run.integrate(other, run.rest())
    np.testing.assert_allclose(there.pose, here.pose * [1, -1, -1], atol=1e-10)
    np.testing.assert_allclose(there.kappa, -here.kappa, atol=1e-8)


def test_stiffer_bodies_converge_to_the_complex_model_at_first_order():
    timeline = Timeline.of_gait(wave(), 1.0)
    rigid = Integrator(wpi_srs())
    exact = rigid.integrate(timeline, rigid.rest(), 1e-7).pose[-1]
    gaps = []
    for stiffness in (1.0, 4.0, 16.0, 64.0):
        run = Integrator(soft(stiffness))
        gaps.append(np.linalg.norm(run.integrate(timeline, run.rest(), 1e-7).pose[-1] - exact))
    orders = np.log(np.divide(gaps[:-1], gaps[1:])) / math.log(4)
    assert orders[-1] == pytest.approx(1.0, abs=0.1), (gaps, orders)
    assert gaps[-1] < 1e-4


def _moments(run, timeline, path, p):
    """Bending moments of the rigid model along its own motion, N m."""
    inverse = inverse_dynamics(run.structure)
    parameters, m, actuator = build(run.structure)
    act, valve, momentum = ca.SX.sym("act", 8), ca.SX.sym("valve", 4), ca.SX.sym("momentum")
    rates = ca.Function(
        "rates", [act, valve, parameters.vector], [actuator.rates(actuator.unstack(act), valve).dkappa]
    )
    spin = ca.Function("spin", [m.kappa, m.dkappa, momentum, parameters.vector], [m.yaw_rate(momentum)])
    ends = np.cumsum(timeline.duration_s)
    phase = np.minimum(np.searchsorted(ends, path.time_s, side="right"), ends.size - 1)
    moments = []
    for kappa, dkappa, pose, velocity, now in zip(path.kappa, path.dkappa, path.pose, path.velocity, phase):
        ddkappa = rates(np.r_[kappa, dkappa], timeline.valve[:, now], p)
        body = ca.vertcat(velocity[:2], spin(kappa, dkappa, velocity[2], p))
        moments.append(np.asarray(inverse(kappa, dkappa, ddkappa, pose, body, p)[0]).ravel())
    return np.array(moments)


def test_loss_of_bend_to_first_order_in_the_flexibility():
    """kappa = kappa0 - d with t_r d' + d = M/EI, M the rigid model's bending moment on kappa0."""
    timeline, rigid = Timeline.of_gait(wave(), 0.6), Integrator(wpi_srs())
    free = rigid.integrate(timeline, rigid.rest(), 1e-8)
    moments = _moments(rigid, timeline, free, rigid.pack(55.0, 2.0))
    times = np.linspace(0, 0.6, 6001)
    drive = np.stack([np.interp(times, free.time_s, column) for column in moments.T], axis=1)
    d, decay = np.zeros_like(drive), math.exp(-times[1] / RELAXATION_S)
    for k in range(1, times.size):
        d[k] = decay * d[k - 1] + (1 - decay) * (drive[k] + drive[k - 1]) / 2
    errors, late = [], times > 0.1
    for stiffness in (0.5, 4.0):
        run = Integrator(soft(stiffness))
        path = run.integrate(timeline, run.rest(), 1e-8)
        columns = (path.no_load - path.kappa).T * stiffness
        lost = np.stack([np.interp(times, path.time_s, column) for column in columns], axis=1)
        errors.append(np.sqrt(np.mean((lost - d)[late] ** 2) / np.mean(d[late] ** 2)))
    assert errors[0] < 0.1
    assert errors[1] < 0.025


# independent program, from rest, friction smoothed at 1 mm/s, relaxation 5 ms
STRAIGHT = {
    (math.pi / 2, 55): {0.02: 0.233, 0.01: 0.272, 0.005: 0.246, 0.003: 0.224, 0.002: 0.239},
    (0.90, 41): {0.02: 0.520, 0.01: 0.494, 0.005: 0.404},
}
RADII = {0.02: 0.246, 0.01: 0.246, 0.005: 0.236, 0.003: 0.225, 0.002: 0.210}
LAST = 15


def last_cycles(robot, gait):
    run = Integrator(robot)
    path = run.integrate(Timeline.of_gait(gait, (LAST + 5) * gait.period_s), run.rest())
    return [motion_of_cycle(run, path, gait, k) for k in range(LAST, LAST + 5)]


@pytest.mark.parametrize(
    ("lag", "pressure", "stiffness", "speed"),
    [(*gait, ei, v) for gait, table in STRAIGHT.items() for ei, v in table.items()],
)
def test_known_speeds_from_rest(lag, pressure, stiffness, speed):
    cycles = last_cycles(soft(stiffness, friction_speed_m_s=0.001), wave(2.0, pressure, lag))
    assert np.mean([c.speed_m_s for c in cycles]) == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize(("stiffness", "radius"), RADII.items())
def test_known_radii(stiffness, radius):
    cycles = last_cycles(soft(stiffness, friction_speed_m_s=0.001), wave(offset=0.4))
    assert np.mean([c.radius_m for c in cycles]) == pytest.approx(radius, rel=0.01)
    if stiffness == 0.005:
        assert cycles[-1].speed_m_s == pytest.approx(0.235, rel=0.01)
        assert cycles[-1].turn_rate_rad_s == pytest.approx(1.00, rel=0.01)


def test_gaps_are_springs_in_series():
    """A rigid chamber with soft gaps equals the soft chamber of the same stiffness in series."""
    l, gap = 0.037, 0.012
    gaps = wpi_srs().with_values(gap_stiffness_n_m2=0.004 * gap / l)
    both = soft(0.008, gap_stiffness_n_m2=0.008 * gap / l)
    timeline = Timeline.of_gait(wave(), 1.0)
    ends = [
        (run := Integrator(robot)).integrate(timeline, run.rest()).pose[-1]
        for robot in (soft(0.004), gaps, both)
    ]
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-8)
    np.testing.assert_allclose(ends[2], ends[0], rtol=1e-8)


def test_commands_take_the_robots_own_model(tmp_path, capsys):
    robot = tmp_path / "soft.yaml"
    robot.write_text("bending_stiffness_n_m2: 0.005\n")
    shared = ["--json", "--duration", "8", "--out", str(tmp_path / "out")]
    speeds = {}
    for options in ((), ("--model", "complex")):
        assert main([*shared, "--robot", str(robot), *options]) == 0
        speeds[options] = json.loads(capsys.readouterr().out)["speed_m_s"]
    assert speeds[()] == pytest.approx(0.246, rel=0.01)
    assert speeds["--model", "complex"] == pytest.approx(0.2315, rel=0.01)
    assert main([*shared, "--model", "compliant"]) == 2
    assert "is rigid" in capsys.readouterr().err


def test_default_model_follows_the_robot_file():
    robot = soft(0.005)
    assert Structure.of(robot).model == "compliant"
    assert Structure.of(robot, "complex").model == "complex"
    assert Structure.of(wpi_srs()).model == "complex"
    assert robot.bending_relaxation_s == 0.005
    assert robot.with_values(bending_stiffness_n_m2=None).fingerprint() == wpi_srs().fingerprint()
    with pytest.raises(InputError, match="is rigid"):
        Structure.of(wpi_srs(), "compliant")

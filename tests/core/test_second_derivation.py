"""The complex model against two other derivations: a Lagrangian and Newton-Euler with joint forces."""

import casadi as ca
import numpy as np
import oracle_snake as oracle
import pytest
from oracle_snake import BODY, GROUND, ROOM

from srs_opt.model.inverse import curvature_controller, forward_dynamics, inverse_dynamics
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.robot import wpi_srs

CASES = [
    (3, []),
    (4, BODY),
    (5, []),
    (5, BODY + GROUND),
    (5, BODY + GROUND + ROOM),
    (8, GROUND),
    (12, BODY + ROOM),
]


def snake(links, effects, law="per_axis"):
    changes = {"links": links, "effects": effects, "friction_law": law, "link_inertia_kg_m2": 2e-5}
    return wpi_srs().with_values(**changes)


def model_rates(robot, s, model="complex"):
    """Rates of the model's body velocity at an oracle's state."""
    parameters, mechanics, _ = build(Structure.of(robot, model))
    pose, velocity = ca.SX.sym("pose", 3), ca.SX.sym("velocity", 3)
    rate, power = mechanics.velocity_rate(pose, velocity)
    f = ca.Function(
        "f",
        [mechanics.kappa, mechanics.dkappa, pose, velocity, parameters.vector],
        [rate, mechanics.pose_rate(pose, velocity), power],
    )
    place, u, spin = oracle.body_state(robot, s)
    out = f(s.kappa, s.dkappa, place, [u[0], u[1], spin], parameters.pack(robot, 50, 1))
    return [np.asarray(v).ravel() for v in out]


def close(a, b, tolerance=1e-9):
    np.testing.assert_allclose(a, b, rtol=tolerance, atol=tolerance * np.abs(b).max())


@pytest.mark.parametrize("law", ["per_axis", "cone"])
@pytest.mark.parametrize(("links", "effects"), CASES)
def test_three_derivations_agree(links, effects, law):
    robot = snake(links, effects, law)
    inverse = inverse_dynamics(Structure.of(robot))
    p = build(Structure.of(robot))[0].pack(robot, 50, 1)
    lagrange = oracle.lagrangian(links)
    rng = np.random.default_rng(links)
    for _ in range(5):
        s, ddkappa = oracle.random_state(rng, links), rng.normal(size=links - 1) * 2000
        newton = oracle.newton_euler(robot, s, ddkappa)
        other = oracle.lagrangian_motion(robot, lagrange, s, ddkappa)
        close(oracle.accelerations(robot, s, other["tail"], ddkappa)[0], newton["acceleration"])
        close(other["torque"], newton["torque"])
        expected = oracle.body_rate(robot, s, newton["acceleration"], newton["angular"])
        place, u, _ = oracle.body_state(robot, s)
        torque, rate = (np.asarray(v).ravel() for v in inverse(s.kappa, s.dkappa, ddkappa, place, u, p))
        close(rate, expected)
        close(torque, newton["torque"])
        momentum_rate, pose_rate, _ = model_rates(robot, s)
        close(momentum_rate[:2], expected[:2])
        r, _, _, _ = oracle.motion(oracle.Body.of(robot), s)
        arm = r - complex(*place[:2])
        close(momentum_rate[2], oracle.cross(arm, oracle.external_forces(robot, s)).sum())
        assert pose_rate[2] == pytest.approx(u[2], rel=1e-9)


@pytest.mark.parametrize("links", [3, 5, 9])
def test_forward_dynamics_inverts_inverse_dynamics(links):
    robot = snake(links, BODY)
    structure = Structure.of(robot)
    p = build(structure)[0].pack(robot, 50, 1)
    rng = np.random.default_rng(1)
    s, wanted = oracle.random_state(rng, links), rng.normal(size=links - 1) * 500
    place, u, _ = oracle.body_state(robot, s)
    torque, rate = inverse_dynamics(structure)(s.kappa, s.dkappa, wanted, place, u, p)
    ddkappa, rate_back = forward_dynamics(structure)(s.kappa, s.dkappa, torque, place, u, p)
    close(np.asarray(ddkappa).ravel(), wanted, 1e-7)
    close(np.asarray(rate_back), np.asarray(rate), 1e-7)


@pytest.mark.parametrize("links", [3, 5, 8])
def test_power_of_all_forces_is_the_rate_of_the_kinetic_energy(links):
    """Also where the gaps bend: the actuators' power is sum T_i l kappa_i'."""
    robot = snake(links, BODY + GROUND)
    rng = np.random.default_rng(2)
    s, ddkappa = oracle.random_state(rng, links), rng.normal(size=links - 1) * 500
    found = oracle.newton_euler(robot, s, ddkappa)
    structure = Structure.of(robot)
    place, u, _ = oracle.body_state(robot, s)
    p = build(structure)[0].pack(robot, 50, 1)
    torque = np.asarray(inverse_dynamics(structure)(s.kappa, s.dkappa, ddkappa, place, u, p)[0]).ravel()
    body = oracle.Body.of(robot)
    _, v, _, omega = oracle.motion(body, s)
    gained = body.mass @ (v.conj() * found["acceleration"]).real + body.inertia * omega @ found["angular"]
    external = (v.conj() * oracle.external_forces(robot, s)).real.sum()
    assert torque @ (robot.segment_length_m * s.dkappa) + external == pytest.approx(gained, rel=1e-9)


def test_friction_power_is_what_the_wheels_dissipate():
    robot = snake(5, BODY + GROUND[1:])
    s = oracle.random_state(np.random.default_rng(3), 5)
    _, v, _, _ = oracle.motion(oracle.Body.of(robot), s)
    _, _, power = model_rates(robot, s)
    assert power[0] == pytest.approx(-(v.conj() * oracle.external_forces(robot, s)).real.sum(), rel=1e-9)


def test_moving_and_turning_the_frame_changes_nothing_that_the_robot_feels():
    robot = snake(5, BODY + GROUND)
    s = oracle.random_state(np.random.default_rng(4), 5)
    turn = np.exp(0.7j)
    moved = oracle.State(
        3 - 2j + turn * s.tail, s.heading + 0.7, s.kappa, turn * s.tail_rate, s.heading_rate, s.dkappa
    )
    for model in ("complex", "simplified"):
        close(model_rates(robot, moved, model)[0], model_rates(robot, s, model)[0], 1e-11)


def test_mirrored_state_has_mirrored_rates():
    robot = snake(5, [BODY[0], GROUND[0]])
    s = oracle.random_state(np.random.default_rng(5), 5)
    mirrored = oracle.State(
        s.tail.conjugate(), -s.heading, -s.kappa, s.tail_rate.conjugate(), -s.heading_rate, -s.dkappa
    )
    for model in ("complex", "simplified"):
        close(model_rates(robot, mirrored, model)[0], model_rates(robot, s, model)[0] * [1, -1, -1], 1e-11)


def integrate(rate, state, duration, rtol=1e-9):
    from scipy.integrate import solve_ivp

    return solve_ivp(
        rate, (0, duration), state, method="Radau", rtol=rtol, atol=1e-11, max_step=duration / 20
    )


def energies(robot, velocities, kappas, dkappas):
    """Kinetic energy along a motion, from the oracle's kinematics."""
    body = oracle.Body.of(robot)
    result = []
    for u, kappa, dkappa in zip(velocities, kappas, dkappas):
        zero = oracle.State(0j, 0.0, kappa, 0j, 0.0, dkappa)
        r, v, theta, omega = oracle.motion(body, zero)
        spin = u[2] - omega.mean()
        centre, drift = body.mass @ r / body.mass.sum(), body.mass @ v / body.mass.sum()
        local = (v - drift) + 1j * spin * (r - centre)
        turn = np.exp(-1j * theta.mean())
        speed = complex(u[0], u[1]) + local * turn
        result.append(0.5 * body.mass @ abs(speed) ** 2 + 0.5 * body.inertia * ((omega + spin) ** 2).sum())
    return np.array(result)


def test_limp_robot_only_loses_energy():
    """T = 0: forward dynamics without torque; friction takes kinetic energy out, and exactly its power."""
    robot = snake(5, BODY).with_values(friction_speed_m_s=0.02)
    forward = forward_dynamics(Structure.of(robot))
    p = build(Structure.of(robot))[0].pack(robot, 0, 1)

    def rate(_t, z):
        ddkappa, du = forward(z[:4], z[4:8], np.zeros(4), z[8:11], z[11:14], p)
        c, s = np.cos(z[10]), np.sin(z[10])
        pose_rate = [c * z[11] - s * z[12], s * z[11] + c * z[12], z[13]]
        return np.concatenate([z[4:8], np.asarray(ddkappa).ravel(), pose_rate, np.asarray(du).ravel()])

    start = np.concatenate([[3, -2, 4, 5], [40, -30, 20, -50], np.zeros(3), [0.3, 0.2, 2.0]])
    done = integrate(rate, start, 0.15, 1e-7)
    z = done.y.T
    energy = energies(robot, z[:, 11:14], z[:, :4], z[:, 4:8])
    assert energy[0] > 0.005
    assert (np.diff(energy) < 1e-9 * energy[0]).all()
    assert energy[-1] < 0.9 * energy[0]


@pytest.mark.parametrize("model", ["complex", "simplified"])
def test_locked_robot_only_loses_energy(model):
    robot = snake(5, []).with_values(friction_speed_m_s=0.02)
    parameters, mechanics, _ = build(Structure.of(robot, model))
    pose, velocity = ca.SX.sym("pose", 3), ca.SX.sym("velocity", 3)
    rates = ca.vertcat(mechanics.pose_rate(pose, velocity), mechanics.velocity_rate(pose, velocity)[0])
    f = ca.Function("f", [mechanics.kappa, mechanics.dkappa, pose, velocity, parameters.vector], [rates])
    inertia = ca.Function("i", [mechanics.kappa, parameters.vector], [mechanics.yaw_inertia()])
    p, kappa = parameters.pack(robot, 0, 1), np.array([5.0, -8.0, 3.0, 9.0])
    j = float(inertia(kappa, p))
    done = integrate(
        lambda _t, z: np.asarray(f(kappa, np.zeros(4), z[:3], z[3:], p)).ravel(),
        np.array([0, 0, 0, 0.4, 0.3, 5 * j]),
        0.3,
    )
    u = done.y[3:]
    energy = 0.5 * 0.15 * (u[0] ** 2 + u[1] ** 2) + 0.5 * u[2] ** 2 / j
    if model == "complex":  # the simplified model's yaw balance is an approximation: no energy law
        assert (np.diff(energy) <= 1e-9 * energy[0]).all()
    assert energy[-1] < 0.2 * energy[0]


def test_yaw_inertia_of_five_point_masses_in_line():
    """By design 8/3 m l^2 in the simplified model, 10 m l^2 in the complex one (gaps, own inertia zero)."""
    robot = wpi_srs().with_values(gap_length_m=0.0, link_inertia_kg_m2=0.0)
    unit = robot.link_mass_kg * robot.segment_length_m**2
    for model, factor in (("complex", 10.0), ("simplified", 8 / 3)):
        parameters, mechanics, _ = build(Structure.of(robot, model))
        f = ca.Function("i", [mechanics.kappa, parameters.vector], [mechanics.yaw_inertia()])
        assert float(f(np.zeros(4), parameters.pack(robot, 0, 1))) == pytest.approx(factor * unit, rel=1e-12)


def test_simplified_yaw_is_the_neighbours_moments():
    """(12) in numpy: sum j(i) theta_i'' = sum of the neighbours' friction moments, with j(i) of (4)."""
    robot = snake(6, [])
    s = oracle.random_state(np.random.default_rng(7), 6)
    body = oracle.Body.of(robot)
    r, _, _, _ = oracle.motion(body, s)
    f = oracle.external_forces(robot, s)
    moment = sum(oracle.cross(r[k] - r[i], f[k]) for i in range(6) for k in (i - 1, i + 1) if 0 <= k < 6)
    parameters, mechanics, _ = build(Structure.of(robot, "simplified"))
    pose, velocity, ddkappa = ca.SX.sym("pose", 3), ca.SX.sym("velocity", 3), ca.SX.sym("ddk", 5)
    rate, _ = mechanics.velocity_rate(pose, velocity)
    spin = mechanics.yaw_rate(velocity[2])
    # psi'' by the chain rule over the model's own momentum state
    spin_rate = (
        ca.jtimes(spin, mechanics.kappa, mechanics.dkappa)
        + ca.jtimes(spin, mechanics.dkappa, ddkappa)
        + ca.jtimes(spin, velocity, rate)
    )
    angle_rate = mechanics.chain_rate.angle
    relative = ca.jtimes(angle_rate, mechanics.dkappa, ddkappa)
    function = ca.Function(
        "f",
        [mechanics.kappa, mechanics.dkappa, ddkappa, pose, velocity, parameters.vector],
        [spin_rate, relative],
    )
    inertia = ca.Function(
        "m",
        [mechanics.kappa, mechanics.dkappa, parameters.vector],
        [mechanics.yaw_inertia(), mechanics.yaw_momentum_of_shape()],
    )
    p = parameters.pack(robot, 0, 1)
    place, u, _ = oracle.body_state(robot, s)
    j_sum, own = (float(v) for v in inertia(s.kappa, s.dkappa, p))
    wanted = np.random.default_rng(8).normal(size=5) * 800
    psi, relative_value = function(s.kappa, s.dkappa, wanted, place, [u[0], u[1], j_sum * u[2] + own], p)
    theta_rate2 = float(psi) + np.asarray(relative_value).ravel()
    l = robot.segment_length_m
    chord = l * np.sinc(l * s.kappa / 2 / np.pi)
    j = body.mass / 3 * (np.concatenate([[0], chord**2]) + np.concatenate([chord**2, [0]]))
    assert j @ theta_rate2 == pytest.approx(moment, rel=1e-9)


def test_controller_pulls_the_curvature_to_its_reference():
    """Feedback linearization on the full dynamics: the error follows the chosen second-order decay."""
    robot = snake(5, [])
    structure = Structure.of(robot)
    p = build(structure)[0].pack(robot, 50, 1)
    control, forward = curvature_controller(structure, 40.0, 1.0), forward_dynamics(structure)
    reference = np.array([4.0, -3.0, 2.0, -5.0])

    def rate(_t, z):
        torque = control(z[:4], z[4:8], reference, np.zeros(4), np.zeros(4), z[8:11], z[11:14], p)
        ddkappa, du = forward(z[:4], z[4:8], torque, z[8:11], z[11:14], p)
        c, s = np.cos(z[10]), np.sin(z[10])
        pose_rate = [c * z[11] - s * z[12], s * z[11] + c * z[12], z[13]]
        return np.concatenate([z[4:8], np.asarray(ddkappa).ravel(), pose_rate, np.asarray(du).ravel()])

    done = integrate(rate, np.zeros(14), 0.2, 1e-7)
    expected = reference * (1 - (1 + 40 * 0.2) * np.exp(-40 * 0.2))
    np.testing.assert_allclose(done.y[:4, -1], expected, rtol=1e-4)

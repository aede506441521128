"""The integrator: orders of convergence, agreement with scipy across switches, honest error estimates."""

import casadi as ca
import numpy as np
import pytest

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Wave, published_wave
from srs_opt.model.registry import build
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.rosenbrock import BODY_STATES, step_function
from srs_opt.simulate.timeline import Timeline

SMOOTH = wpi_srs().with_values(friction_speed_m_s=0.05)
ROOM = [
    {"name": "floor_slope", "angle": 0.05},
    {"name": "tether_pull", "force_n": 0.05, "ax_m": 1, "ay_m": 1},
]
NONLINEAR = [{"name": "hysteresis", "ratio": 0.35}, {"name": "curvature_stiffening", "per_curv2": 6e-4}]


def moving_state(run):
    """A state in full motion, consistent with nothing in particular."""
    x = run.rest(0.1, 0.2, 0.4)
    x[3:6] = 0.2, -0.1, 2e-4
    x[BODY_STATES : BODY_STATES + 8] = [6, -4, 3, 9, 80, -60, 40, -90]
    return x


@pytest.mark.parametrize("effects", [[], ROOM, NONLINEAR], ids=["plain", "room", "nonlinear actuators"])
@pytest.mark.parametrize("model", ["complex", "simplified"])
def test_a_step_has_order_four(model, effects):
    run = Integrator(SMOOTH.with_values(effects=effects), model)
    x, p, valve = moving_state(run), run.pack(55, 2), np.array([[1.0], [-1], [1], [-1]])

    def end(count):
        mesh = Mesh(np.full(count, 0.04 / count), np.zeros(count, dtype=int))
        return run.steps(x, mesh, valve, p)[0][:, -1]

    exact, scale = end(1024), np.array([1, 1, 1, 1, 1, 1e3, 10])
    errors = np.array([np.abs((end(n) - exact)[:7] * scale).max() for n in (16, 32, 64, 128)])
    orders = np.log2(errors[:-1] / errors[1:])
    assert (orders > 3.6).all(), (errors, orders)
    assert errors[-1] < 1e-7


def test_the_embedded_estimate_has_order_four_and_bounds_the_error():
    run = Integrator(SMOOTH)
    x, p = moving_state(run), run.pack(55, 2)
    step = step_function(run.structure)
    valve = np.array([1.0, -1, 1, -1])
    estimates, errors = [], []
    for h in (0.004, 0.002, 0.001):
        one, estimate = step(x, valve, h, p)
        mesh = Mesh(np.full(32, h / 32), np.zeros(32, dtype=int))
        exact = run.steps(x, mesh, valve[:, None], p)[0][:, -1]
        estimates.append(float(estimate))
        errors.append(np.abs(np.asarray(one).ravel() - exact)[3:5].max())
    orders = np.log2(np.array(estimates[:-1]) / estimates[1:])
    assert (orders > 3.4).all(), orders
    assert all(e <= 2 * s for e, s in zip(errors, estimates))


def test_a_step_of_no_length_does_nothing():
    run = Integrator(wpi_srs())
    x = moving_state(run)
    after, error = step_function(run.structure)(x, np.ones(4), 0.0, run.pack(55, 2))
    np.testing.assert_allclose(np.asarray(after).ravel(), x, rtol=1e-13)
    assert float(error) < 1e-12


@pytest.mark.parametrize("model", ["complex", "simplified"])
@pytest.mark.parametrize("smoothing", [0.002, 0.02])
def test_agrees_with_radau_across_switches(model, smoothing):
    from scipy.integrate import solve_ivp

    robot = wpi_srs().with_values(friction_speed_m_s=smoothing)
    gait = Wave(2.0, 50, (0.0, 1.0, 1.9, 3.0), (0.3, 0.0, 0.2, 0.1)).gait()
    run = Integrator(robot, model)
    parameters, mechanics, actuator = build(run.structure)
    pose, velocity, valve = ca.SX.sym("pose", 3), ca.SX.sym("velocity", 3), ca.SX.sym("valve", 4)
    rate, power = mechanics.velocity_rate(pose, velocity)
    state = actuator.unstack(ca.vertcat(mechanics.kappa, mechanics.dkappa))
    everything = ca.vertcat(
        mechanics.pose_rate(pose, velocity), rate, power, actuator.rates(state, valve).vector()
    )
    x = ca.vertcat(pose, velocity, ca.SX.sym("work"), mechanics.kappa, mechanics.dkappa)
    f = ca.Function("f", [x, valve, parameters.vector], [everything])
    slope = ca.Function("j", [x, valve, parameters.vector], [ca.jacobian(everything, x)])
    p = run.pack(gait.pressure_kpa, gait.frequency_hz)
    state_now = run.rest()
    durations, valves = gait.phases()
    for h, s in zip(durations, valves.T):
        state_now = solve_ivp(
            lambda _t, y, s=s: np.asarray(f(y, s, p)).ravel(),
            (0, h),
            state_now,
            method="Radau",
            jac=lambda _t, y, s=s: np.asarray(slope(y, s, p)),
            rtol=1e-8,
            atol=1e-10,
        ).y[:, -1]
    ours = run.integrate(Timeline.of_gait(gait, gait.period_s), run.rest(), 1e-7).final
    np.testing.assert_allclose(ours[BODY_STATES:], state_now[BODY_STATES:], rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(ours[:3], state_now[:3], atol=3e-6)
    np.testing.assert_allclose(ours[3:5], state_now[3:5], atol=1e-5)
    assert ours[6] == pytest.approx(state_now[6], rel=1e-4)


def test_tolerance_tells_how_exact_the_steady_speed_is():
    gait = published_wave(wpi_srs(), offset=0.3).gait()
    exact = steady_gait(wpi_srs(), gait, tolerance=1e-8).speed_m_s
    errors = [
        abs(steady_gait(wpi_srs(), gait, tolerance=t).speed_m_s / exact - 1) for t in (3e-5, 3e-6, 3e-7)
    ]
    assert errors[0] < 1e-3
    assert errors[1] < 2e-4
    assert errors[2] < 5e-5


def test_steps_end_at_switches_and_errors_are_reported():
    gait = Wave(1.3, 50, (0.1, 1.0, 1.9, 3.0), (0.3, 0.0, 0.2, 0.1)).gait()
    run = Integrator(wpi_srs())
    path = run.integrate(Timeline.of_gait(gait, 3.0), run.rest())
    assert path.time_s[-1] == pytest.approx(3.0)
    assert (np.diff(path.time_s) > 0).all()
    for k in range(3):
        for t in gait.switch_times_s() + k * gait.period_s:
            assert abs(path.time_s - t).min() < 1e-9
    assert path.error_m_s.shape == (path.time_s.size - 1,)
    assert path.error_m_s.max() < 1e-3
    pose, kappa = path.at(np.array([0.5, 1.0]))
    assert pose.shape == (2, 3)
    assert kappa.shape == (2, 4)


def test_energy_balance_along_a_simulated_trajectory():
    """Actuators' work + work of all external forces = gain of kinetic energy, over a running gait."""
    import oracle_snake as oracle
    from test_second_derivation import energies

    from srs_opt.model.inverse import inverse_dynamics

    robot = wpi_srs().with_values(effects=[{"name": "head_mass", "extra_kg": 0.02}], friction_speed_m_s=0.02)
    gait = Wave(2.0, 50, (0.0, 1.0, 1.9, 3.0), (0.3, 0.0, 0.2, 0.1)).gait()
    run = Integrator(robot)
    parameters, mechanics, actuator = build(run.structure)
    p = run.pack(50, 2)
    durations, valves = gait.phases()
    mesh = Mesh.uniform(durations, 2e-4)
    nodes = np.concatenate([run.rest()[:, None], run.steps(run.rest(), mesh, valves, p)[0]], axis=1)
    momentum, x, valve = ca.SX.sym("m"), ca.SX.sym("x", 8), ca.SX.sym("valve", 4)
    spin = ca.Function(
        "w", [mechanics.kappa, mechanics.dkappa, momentum, parameters.vector], [mechanics.yaw_rate(momentum)]
    )
    rates = ca.Function(
        "r", [x, valve, parameters.vector], [actuator.rates(actuator.unstack(x), valve).dkappa]
    )
    inverse = inverse_dynamics(run.structure)
    kappa, dkappa = nodes[7:11].T, nodes[11:15].T
    u = np.array([[n[3], n[4], float(spin(n[7:11], n[11:15], n[5], p))] for n in nodes.T])

    def actuator_power(i, phase):
        acceleration = rates(nodes[7:, i], valves[:, phase], p)
        torque = inverse(kappa[i], dkappa[i], acceleration, nodes[:3, i], u[i], p)[0]
        return robot.segment_length_m * dkappa[i] @ np.asarray(torque).ravel()

    work = sum(
        h / 2 * (actuator_power(i, k) + actuator_power(i + 1, k))
        for i, (h, k) in enumerate(zip(mesh.h_s, mesh.phase))
    )
    bent = np.where(kappa == 0, 1e-3, kappa)  # the oracle's arcs need some bend
    energy = energies(robot, u, bent, dkappa)
    assert oracle.Body.of(robot).mass.sum() == pytest.approx(0.17)
    assert work == pytest.approx(energy[-1] - energy[0] + nodes[6, -1], rel=1e-3)
    assert nodes[6, -1] > 0.01


def test_friction_work_never_falls():
    run = Integrator(wpi_srs())
    path = run.integrate(Timeline.of_gait(published_wave(wpi_srs()).gait(), 2.0), run.rest())
    assert (np.diff(path.work_j) >= -1e-12).all()


def test_start_and_stop():
    """From rest into a gait, vented while it runs: at rest again, straight; and once more from there."""
    robot = wpi_srs()
    gait = published_wave(robot).gait()
    run = Integrator(robot)
    stop = Timeline.join([Timeline.of_gait(gait, 2.0), Timeline.vent(4, 2.0, gait.pressure_kpa)])
    path = run.integrate(stop, run.rest())
    running = path.time_s < 2.0
    assert abs(path.velocity[running, :2]).max() > 0.1
    assert abs(path.velocity[-1, :2]).max() < 1e-4
    assert abs(path.kappa[-1]).max() < 1e-8
    late = path.time_s > 3.5
    assert np.ptp(path.pose[late, :2], axis=0).max() < 1e-4
    again = run.integrate(Timeline.of_gait(gait, 2.0), path.final)
    first = run.integrate(Timeline.of_gait(gait, 2.0), run.rest())
    turn = path.pose[-1, 2]
    moved = again.pose[-1, :2] - again.pose[0, :2]
    back = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) @ moved
    np.testing.assert_allclose(back, first.pose[-1, :2], atol=2e-4)


def test_venting_from_a_running_gait_brings_it_to_rest():
    robot = wpi_srs()
    run = Integrator(robot)
    orbit = steady_gait(robot, published_wave(robot).gait())
    path = run.integrate(Timeline.vent(4, 1.0, 55.0), orbit.solution.start)
    assert abs(path.kappa).max() <= 0.35 * 55.0
    assert abs(path.velocity[-1, :2]).max() < 1e-4


def test_vented_at_rest_stays_at_rest():
    run = Integrator(wpi_srs())
    path = run.integrate(Timeline.vent(4, 1.0, 55.0), run.rest(1.0, 2.0, 3.0))
    np.testing.assert_allclose(path.pose[-1], [1, 2, 3], atol=1e-12)


def test_a_motion_that_is_not_finite_is_an_answer_in_words():
    run = Integrator(wpi_srs())
    x = run.rest()
    x[3] = np.nan
    with pytest.raises(NoAnswerError, match="becomes non-finite"):
        run.integrate(Timeline.vent(4, 0.1, 55.0), x)


def test_meshes_cover_their_phases_whatever_the_errors():
    rng = np.random.default_rng(0)
    for _ in range(50):
        durations = rng.uniform(1e-4, 0.3, rng.integers(1, 9))
        mesh = Mesh.uniform(durations, 0.005)
        for _ in range(3):
            mesh = mesh.refined(10.0 ** rng.uniform(-12, 0, mesh.h_s.size), 1e-5)
            assert (mesh.h_s > 0).all()
            np.testing.assert_allclose(
                np.bincount(mesh.phase, weights=mesh.h_s, minlength=durations.size), durations, rtol=1e-9
            )
        np.testing.assert_allclose(mesh.halved().h_s.sum(), durations.sum())

"""The actuators' closed form against a numerical solution of (15), for any pair of time constants."""

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from srs_opt.gait import Wave
from srs_opt.model.actuator_law import decay
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.orbit.actuators import periodic_actuators
from srs_opt.orbit.body import integrator
from srs_opt.robot import wpi_srs


def advance():
    structure = Structure.of(wpi_srs())
    parameters, _, actuator = build(structure)
    x, valve, t = ca.SX.sym("x", 8), ca.SX.sym("valve", 4), ca.SX.sym("t")
    after = actuator.advance(actuator.unstack(x), valve, t).vector()
    f = ca.Function("f", [x, valve, t, parameters.vector], [after, ca.jacobian(after, parameters.vector)])
    return f, parameters


@pytest.mark.parametrize(
    ("tau1", "tau2"),
    [
        (0.08, 0.05),
        (0.05, 0.08),
        (0.06, 0.06),
        (0.06, 0.06 + 1e-9),
        (0.06, 0.0601),
        (0.5, 0.002),
        (0.3, 0.28),
    ],
)
def test_closed_form_is_the_odes_solution(tau1, tau2):
    f, parameters = advance()
    p = parameters.pack(wpi_srs().with_values(tau1_s=tau1, tau2_s=tau2), 50, 1)
    start = np.array([5.0, -3, 0, 9, 100, -50, 20, 0])
    valve = np.array([1.0, -1, 0, 1])

    def rate(_t, x):
        k, d = x[:4], x[4:]
        return np.concatenate([d, -(1 / tau1 + 1 / tau2) * d - (k - 17.5 * valve) / (tau1 * tau2)])

    for t in (0.001, 0.03, 0.2):
        expected = solve_ivp(rate, (0, t), start, method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]
        np.testing.assert_allclose(
            np.asarray(f(start, valve, t, p)[0]).ravel(), expected, rtol=1e-8, atol=1e-8
        )


def test_holding_twice_is_holding_once_longer():
    f, parameters = advance()
    p, start, valve = parameters.pack(wpi_srs(), 50, 1), np.arange(8.0), np.array([1.0, -1, 1, 0])
    twice = f(f(start, valve, 0.013, p)[0], valve, 0.021, p)[0]
    np.testing.assert_allclose(np.asarray(twice), np.asarray(f(start, valve, 0.034, p)[0]), rtol=1e-12)


def test_continuous_through_equal_time_constants_with_its_derivatives():
    """Across tau_1 = tau_2 and across the border between series and closed form."""
    f, parameters = advance()
    start, valve = np.array([5.0, -3, 0, 9, 100, -50, 20, 0]), np.ones(4)
    tau = 0.06
    i = parameters.names.index("tau2_s")
    for t in (0.01, 0.2):
        border = 1 / (1 / tau + 0.2 / t)  # where half the difference of rates times t is a tenth
        for middle in (tau, border):
            values, slopes = [], []
            for step in (-1e-7, 0.0, 1e-7):
                p = parameters.pack(wpi_srs().with_values(tau1_s=tau, tau2_s=middle + step), 50, 1)
                value, slope = f(start, valve, t, p)
                values.append(np.asarray(value).ravel())
                slopes.append(np.asarray(slope)[:, i])
            np.testing.assert_allclose(slopes[0], slopes[2], rtol=1e-3, atol=1e-3 * abs(slopes[1]).max())
            np.testing.assert_allclose(
                (values[2] - values[0]) / 2e-7, slopes[1], rtol=1e-5, atol=1e-5 * abs(slopes[1]).max()
            )


@pytest.mark.parametrize(("tau1", "tau2"), [(10.0, 1e-4), (1e-4, 10.0), (1e-5, 1e-5)])
def test_unlike_time_constants_do_not_overflow(tau1, tau2):
    for t in (1e-6, 0.01, 5.0):
        phi, dphi = (float(v) for v in decay(ca.DM(t), ca.DM(tau1), ca.DM(tau2)))
        slow, fast = max(tau1, tau2), min(tau1, tau2)
        if slow != fast:
            expected = (np.exp(-t / slow) - np.exp(-t / fast)) / (1 / fast - 1 / slow)
            assert phi == pytest.approx(expected, rel=1e-9)
        assert np.isfinite([phi, dphi]).all()


def test_step_response_is_the_papers():
    """(14): kappa(t) = C0 P (1 - (tau1 e^(-t/tau1) - tau2 e^(-t/tau2))/(tau1 - tau2)) from rest."""
    f, parameters = advance()
    p = parameters.pack(wpi_srs(), 55, 1)
    for t in (0.02, 0.1, 0.5):
        expected = 0.35 * 55 * (1 - (0.08 * np.exp(-t / 0.08) - 0.05 * np.exp(-t / 0.05)) / 0.03)
        assert float(f(np.zeros(8), np.ones(4), t, p)[0][0]) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("effects", [[], [{"name": "hysteresis", "ratio": 0.35}]])
def test_periodic_state_repeats(effects):
    robot = wpi_srs().with_values(effects=effects)
    gait = Wave(1.7, 48.0, (0.0, 1.1, 1.9, 3.1), (0.3, -0.1, 0.2, 0.4)).gait()
    run = integrator(robot)
    p = run.pack(48.0, 1.7)
    act = periodic_actuators(run, gait, p)
    x = run.rest()
    x[7:] = act
    from srs_opt.simulate.mesh import Mesh

    durations, valves = gait.phases()
    end = run.steps(x, Mesh.uniform(durations, 0.001), valves, p)[0][7:, -1]
    np.testing.assert_allclose(end, act, rtol=1e-4, atol=1e-4 * abs(act).max())

"""The program's equations against finite differences, the closed-form curvature against integration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from srs_opt.gait import Wave
from srs_opt.gait_opt.collocation.guess import gait_of, switches_of, unknowns_from_orbits
from srs_opt.gait_opt.collocation.layout import Mesh
from srs_opt.gait_opt.collocation.phases import exchanged, phase_cuts, phase_times, switch_order
from srs_opt.gait_opt.collocation.point import PointKind, linear_shape
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs

ROBOT = wpi_srs()
ENDS = np.array([0.0, 1.0])  # of the cycle; elements spread evenly
GAIT = Wave(1.7, 47.0, (0.3, 1.2, 1.95, 2.9), (0.1, -0.2, 0.05, 0.3)).gait()


def problem(**changes) -> CycleProblem:
    return CycleProblem((ROBOT,), "complex", Goal(**changes), Limits())


def derivative_errors(p, z, parameters, step=1e-6):
    """Return the relative errors of Jacobian and Hessian along one random direction."""
    random = np.random.default_rng(1)
    d = random.normal(size=z.size)
    slope, bend = p._options["jac_g"], p._options["hess_lag"]

    def rows(x):
        return np.asarray(p.evaluate(x, parameters)).ravel()

    multipliers = random.normal(size=p.rows)

    def gradient(x):
        return np.asarray(slope(x, parameters)[1].T @ multipliers).ravel()

    first = np.asarray(slope(z, parameters)[1] @ d).ravel()
    upper = np.asarray(bend(z, parameters, 1.0, multipliers))
    second = (np.triu(upper) + np.triu(upper, 1).T) @ d
    first_fd = (rows(z + step * d) - rows(z - step * d)) / (2 * step)
    second_fd = (gradient(z + step * d) - gradient(z - step * d)) / (2 * step)
    return (
        np.abs(first - first_fd).max() / np.abs(first).max(),
        np.abs(second - second_fd).max() / np.abs(second).max(),
    )


@pytest.mark.parametrize("goal", [{}, {"objective": "turn", "radius_m": 0.3, "envelope_m": 0.08}])
def test_derivatives_agree_with_differences(goal):
    smooth = replace(ROBOT, friction_speed_m_s=0.1)
    case, mesh = problem(**goal), Mesh.uniform(20)
    p = case.program(20)
    z, scales = unknowns_from_orbits(p.layout, [ROBOT], [steady_gait(smooth, GAIT)], mesh)
    first, second = derivative_errors(p, z, case.parameters(p, mesh, scales, 0.1))
    assert first < 1e-6
    assert second < 1e-5


def test_derivatives_with_phases_that_end_at_switches():
    smooth = replace(ROBOT, friction_speed_m_s=0.1)
    switches = switches_of(GAIT, GAIT.intervals[0][0][0])
    order = switch_order(switches)
    mesh, times = phase_times(switches, order, phase_cuts(switches, order, ENDS, 24 * ENDS))
    case = problem()
    p = case.program(mesh.elements, times)
    z, scales = unknowns_from_orbits(p.layout, [ROBOT], [steady_gait(smooth, GAIT)], mesh)
    first, second = derivative_errors(p, z, case.parameters(p, mesh, scales, 0.1))
    assert first < 1e-6
    assert second < 1e-5


@pytest.mark.parametrize("tau2", [0.05, 0.08, 0.0801])
def test_closed_form_curvature_is_the_settled_response(tau2):
    robot = replace(ROBOT, tau2_s=tau2)
    kind = PointKind(Structure.of(robot))
    at = np.linspace(0.02, 0.99, 23)
    first = GAIT.intervals[0][0][0]
    numbers = build(kind.structure)[0].pack(robot, 1.0, 1.0)
    kappa, rate = linear_shape(kind, at.size)(
        switches_of(GAIT, first), GAIT.frequency_hz, GAIT.pressure_kpa, at[None], numbers, 1e-4
    )
    x = np.zeros(8)
    target = robot.curvature_per_pressure_1_m_kpa * GAIT.pressure_kpa
    tau1 = robot.tau1_s
    durations, valves = GAIT.phases()

    def slope(_, y, valve):
        bend, dbend = y[:4], y[4:]
        return np.r_[dbend, (target * valve - bend) / (tau1 * tau2) - (1 / tau1 + 1 / tau2) * dbend]

    samples = (first + at * GAIT.period_s) % GAIT.period_s
    for cycle in range(6):
        clock = 0.0
        for duration, valve in zip(durations, valves.T):
            inside = [t - clock for t in samples if clock <= t < clock + duration]
            done = solve_ivp(slope, (0, duration), x, args=(valve,), rtol=1e-9, atol=1e-9, dense_output=True)
            if cycle == 5:
                for t in inside:
                    k = int(np.argmin(np.abs(samples - clock - t)))
                    assert np.asarray(kappa)[:, k] == pytest.approx(done.sol(t)[:4], abs=2e-3 * target)
                    assert np.asarray(rate)[:, k] == pytest.approx(done.sol(t)[4:], abs=2e-2 * target)
            x, clock = done.y[:, -1], clock + duration


def held_gait(case, orbit, elements):
    """Solve with an orbit's gait held and the turn free: program, unknowns and their scales."""
    gait = orbit.gait
    switches = switches_of(gait, gait.intervals[0][0][0])
    order = switch_order(switches)
    mesh, times = phase_times(switches, order, phase_cuts(switches, order, ENDS, elements * ENDS))
    p = case.program(mesh.elements, times)
    z, scales = unknowns_from_orbits(p.layout, list(case.robots), [orbit], mesh)
    (low, high), rows = case.bounds(p)
    held = slice(0, 2 + p.layout.switches)
    low[held] = high[held] = z[held]
    turn = p.layout.unknown(0, "turn_rate")
    low[turn], high[turn] = -10, 10
    solution = p.solve(z, case.parameters(p, mesh, scales, 0.03), (low, high), rows)
    assert solution.converged
    return p, solution.z, scales


def test_collocation_converges_to_the_simulated_orbit():
    """With the gait held, the program's speed approaches the simulation's as elements are added."""
    smooth = replace(ROBOT, friction_speed_m_s=0.03)
    orbit = steady_gait(smooth, GAIT)
    case = CycleProblem((smooth,), "complex", Goal("turn", turn_rate_rad_s=orbit.turn_rate_rad_s), Limits())
    errors = []
    for elements in (16, 48):
        p, z, _ = held_gait(case, orbit, elements)
        errors.append(abs(z[p.layout.unknown(0, "speed")] / orbit.speed_m_s - 1))
    assert errors[1] < 2e-4
    assert errors[1] < errors[0] / 3


def test_switches_round_trip():
    first = GAIT.intervals[0][0][0]
    again = gait_of(switches_of(GAIT, 0.0), GAIT.frequency_hz, GAIT.pressure_kpa, 1)
    assert np.ravel(again.intervals) == pytest.approx(np.ravel(GAIT.intervals), abs=1e-12)
    switches = switches_of(GAIT, first)
    assert switches[0] == 0
    assert (switches[1::2] > switches[0::2]).all()


def test_orders_are_exchanged_where_switches_meet():
    switches = np.array([0.0, 0.5, 0.3, 0.8, 0.3, 0.9])
    order = switch_order(switches)
    new = exchanged(switches, order)
    assert new is not None
    assert sorted(new) == sorted(order)
    assert list(new) != list(order)
    assert exchanged(np.array([0.0, 0.5, 0.3, 0.8]), np.array([0, 2, 1, 3])) is None

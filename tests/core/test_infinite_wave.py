"""Chains of many short links against the theory of the infinite serpenoid wave (cone law, no inertia).

The driver is the test's own: a prescribed curvature wave through the model's mechanics, the body's velocity
from the balance of forces and moments at every instant.
"""

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from srs_opt.gait import Wave
from srs_opt.model.friction import FRICTION_LAWS
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs


class Chain:
    """Quasi-static motion of a robot whose headings follow a travelling sine."""

    def __init__(self, robot):
        parameters, mechanics, _ = build(Structure.of(robot))
        u = ca.SX.sym("u", 3)
        forces = mechanics.forces(ca.SX.zeros(3, 1), u[0], u[1], u[2])
        net = ca.vertcat(ca.sum1(forces.x), ca.sum1(forces.y), mechanics.yaw_momentum_rate(forces, u[2]))
        shape = [mechanics.kappa, mechanics.dkappa]
        self.balance = ca.Function(
            "b", [u, *shape, parameters.vector], [net, ca.jacobian(net, u)], {"cse": True}
        )
        self.p = parameters.pack(robot, 0, 1)
        self.robot = robot

    def velocity(self, kappa, dkappa, u):
        """Damped Newton on the smooth balance (the forces are the gradient of a convex dissipation)."""
        for _ in range(200):
            net, slope = (np.asarray(v) for v in self.balance(u, kappa, dkappa, self.p))
            if np.abs(net).max() < 1e-11:
                return u
            step = -np.linalg.solve(slope, net.ravel())
            factor, size = 1.0, np.linalg.norm(net / [[1], [1], [0.1]])
            while factor > 1e-6:
                trial = np.asarray(self.balance(u + factor * step, kappa, dkappa, self.p)[0])
                if np.linalg.norm(trial / [[1], [1], [0.1]]) < size:
                    break
                factor /= 2
            u = u + factor * step
        raise AssertionError("no balance of forces")

    def speed_ratio(self, amplitude, waves, steps=24):
        """Speed of the body over the speed of the wave along the arc, and that of the travelled path."""
        n, l = self.robot.segments, self.robot.segment_length_m
        length = n * l
        place = (np.arange(n) + 0.5) / n  # middle of the segments, tail to head
        wavenumber, omega = 2 * np.pi * waves, 2 * np.pi
        # heading = amplitude cos(wavenumber s + omega t): the wave runs from head to tail
        u, pose, positions = np.zeros(3), 0j, [0j]
        heading = 0.0
        for k in range(steps):
            phase = wavenumber * place + omega * (k + 0.5) / steps
            size = amplitude * 2 * np.sin(wavenumber / n / 2) / l  # differences of the links' headings
            kappa, dkappa = -size * np.sin(phase), -size * omega * np.cos(phase)
            u = self.velocity(kappa, dkappa, u)
            heading += u[2] / steps / 2
            pose += complex(u[0], u[1]) * np.exp(1j * heading) / steps
            heading += u[2] / steps / 2
            positions.append(pose)
        wave_speed = length / waves  # per period of one second
        return abs(positions[-1]) / wave_speed


def short_links(links, eps):
    return wpi_srs().with_values(
        links=links,
        segment_length_m=1.0 / (links - 1),
        gap_length_m=0.0,
        friction_law="cone",
        friction_tangential=0.5 * eps,
        friction_normal=0.5,
        friction_speed_m_s=1e-4,
        link_mass_kg=1.0 / links,
        link_inertia_kg_m2=0.0,
    )


TABLE = [(0.01, 0.864, 0.52), (0.0754, 0.648, 0.825), (0.1, 0.599, 0.88), (0.333, 0.306, 1.135)]


@pytest.mark.parametrize(("eps", "ratio", "amplitude"), TABLE)
def test_many_short_links_approach_the_infinite_wave(eps, ratio, amplitude):
    coarse = Chain(short_links(17, eps)).speed_ratio(amplitude, 2)
    fine = Chain(short_links(64, eps)).speed_ratio(amplitude, 4)
    assert abs(fine - ratio) <= abs(coarse - ratio)
    assert fine == pytest.approx(ratio, rel=0.05)


@pytest.mark.parametrize(("eps", "ratio", "amplitude"), TABLE[1:3])
def test_the_tables_amplitude_is_about_the_best(eps, ratio, amplitude):
    chain = Chain(short_links(49, eps))
    best = chain.speed_ratio(amplitude, 4)
    assert chain.speed_ratio(0.75 * amplitude, 4) < best
    assert chain.speed_ratio(1.3 * amplitude, 4) < best


def infinite_wave(amplitude, eps, points=200):
    """Return (speed over the wave's along the arc, friction work over the least possible, mu_t m g d).

    Headings amplitude cos(k s), the body sliding along its path at speed 1 while the path itself slips
    backwards at w; the slip is where the model's own friction law balances along the way.
    """
    v_t, v_n = ca.SX.sym("v_t"), ca.SX.sym("v_n")
    law = ca.Function("law", [v_t, v_n], list(FRICTION_LAWS["cone"](v_t, v_n, 1e-6))).map(points)
    heading = amplitude * np.cos(2 * np.pi * (np.arange(points) + 0.5) / points)
    c, s = np.cos(heading), np.sin(heading)

    def forces(slip):
        along, across = 1 - slip * c, slip * s
        d_t, d_n = (np.asarray(d).ravel() for d in law(along[None], across[None]))
        return along, across, eps * d_t, d_n

    def drag(slip):
        _, _, f_t, f_n = forces(slip)
        return np.mean(f_t * c - f_n * s)

    slip = brentq(drag, 1e-9, 1.0)
    along, across, f_t, f_n = forces(slip)
    speed = c.mean() - slip
    return speed, np.mean(f_t * along + f_n * across) / (eps * speed)


@pytest.mark.parametrize(("eps", "ratio", "amplitude"), TABLE)
def test_friction_law_gives_the_infinite_waves_table(eps, ratio, amplitude):
    assert infinite_wave(amplitude, eps)[0] == pytest.approx(ratio, abs=0.002)
    for other in (0.95 * amplitude, 1.05 * amplitude):
        assert infinite_wave(other, eps)[0] < infinite_wave(amplitude, eps)[0] + 1e-4


def test_most_efficient_amplitude_falls_as_the_fourth_root():
    """Alben (2013): as mu_n^(-1/4), the limit of large mu_n over mu_t."""
    ratios = np.array([1e-3, 1e-4, 1e-5])
    best = [
        minimize_scalar(lambda a, e=eps: infinite_wave(a, e)[1], bounds=(0.01, 1.0), method="bounded").x
        for eps in ratios
    ]
    slopes = np.diff(np.log(best)) / np.diff(np.log(ratios))
    assert slopes == pytest.approx(0.25, abs=0.01)


def test_best_lag_of_five_links_in_the_viscous_limit():
    """Small amplitude, viscous friction, negligible inertia: 50.6 degrees between segments."""
    robot = wpi_srs().with_values(
        friction_law="cone", friction_speed_m_s=1.0, link_inertia_kg_m2=0.0, gap_length_m=0.0
    )
    chain = Chain(robot)

    def distance(lag, amplitude=0.2, steps=32):
        u, pose, heading = np.zeros(3), 0j, 0.0
        for k in range(steps):
            phase = lag * np.arange(4) + 2 * np.pi * (k + 0.5) / steps
            kappa, dkappa = amplitude * np.sin(phase), 2 * np.pi * amplitude * np.cos(phase)
            net, slope = (np.asarray(v) for v in chain.balance(u, kappa, dkappa, chain.p))
            for _ in range(6):
                u = u - np.linalg.solve(slope, net.ravel())
                net, slope = (np.asarray(v) for v in chain.balance(u, kappa, dkappa, chain.p))
            middle = heading + u[2] / steps / 2
            pose += complex(u[0], u[1]) * np.exp(1j * middle) / steps
            heading += u[2] / steps
        return pose.real

    lags = np.radians(np.arange(40.0, 62.0, 1.0))
    values = np.array([distance(lag) for lag in lags])
    k = int(np.argmax(values))
    a, b, _ = np.polyfit(lags[k - 1 : k + 2], values[k - 1 : k + 2], 2)
    assert np.degrees(-b / (2 * a)) == pytest.approx(50.6, abs=0.5)
    assert values[k] > 0


def test_best_lag_of_steady_gaits_in_the_viscous_limit():
    """The same by the simulated valves: slow actuators leave little of the square wave's harmonics."""
    robot = wpi_srs().with_values(
        friction_law="cone",
        friction_speed_m_s=0.1,
        link_inertia_kg_m2=0.0,
        gap_length_m=0.0,
        tau1_s=10.0,
        tau2_s=9.0,
    )
    lags = np.radians([48.0, 50.0, 52.0, 54.0])
    speeds = [
        steady_gait(robot, Wave.uniform(4, 0.1, 60, lag).gait(), tolerance=1e-8).speed_m_s for lag in lags
    ]
    a, b, _ = np.polyfit(lags, speeds, 2)
    assert np.degrees(-b / (2 * a)) == pytest.approx(50.6, abs=0.7)

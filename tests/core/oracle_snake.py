"""Oracles written apart from the package: complex-number kinematics, Newton-Euler with joint forces, a
Lagrangian in tail coordinates, and the effects' definitions in plain numpy. Nothing here imports a model.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

# effects that the derivations are compared with, by what they act on
BODY = [{"name": "head_mass", "extra_kg": 0.02}, {"name": "gap_bending", "ratio": 0.6}]
GROUND = [
    {"name": "tether_weight", "load_n": 0.2},
    {"name": "wheel_toe", "angle": 0.03},
    {"name": "stribeck", "excess": 1.0, "speed": 0.08},
    {"name": "slip_rate", "per_speed": 8.0},
    {"name": "gap_length", "extra_m": 0.008},
]
ROOM = [
    {"name": "floor_slope", "angle": 0.01, "direction": 1.0},
    {"name": "tether_pull", "force_n": 0.03, "ax_m": 4.0, "ay_m": 5.0},
]


def effect(robot, name):
    """Return the robot's (single) effect `name`, or an empty mapping."""
    found = [e for e in robot.effects if e["name"] == name]
    return found[0] if found else {}


def size(robot, name, key):
    return effect(robot, name).get(key, 0.0)


@dataclass(frozen=True)
class Body:
    """Lengths and masses of a robot with its effects."""

    links: int
    l: float
    gap: float
    ratio: float
    mass: np.ndarray
    inertia: float

    @staticmethod
    def of(robot) -> Body:
        mass = np.full(robot.links, robot.link_mass_kg)
        mass[-1] += size(robot, "head_mass", "extra_kg")
        return Body(
            robot.links,
            robot.segment_length_m,
            robot.gap_length_m + size(robot, "gap_length", "extra_m"),
            size(robot, "gap_bending", "ratio"),
            mass,
            robot.link_inertia_kg_m2,
        )

    @property
    def turn(self) -> float:
        """theta_{i+1} - theta_i per curvature."""
        return self.l + self.ratio * self.gap


@dataclass(frozen=True)
class State:
    """Tail position (complex), tail heading, curvatures, and their rates."""

    tail: complex
    heading: float
    kappa: np.ndarray
    tail_rate: complex
    heading_rate: float
    dkappa: np.ndarray


def random_state(rng: np.random.Generator, links: int, speed: float = 0.3) -> State:
    signs = rng.choice([-1.0, 1.0], links - 1)
    return State(
        complex(*rng.normal(size=2)),
        rng.uniform(-3, 3),
        signs * rng.uniform(2.0, 18.0, links - 1),
        speed * complex(*rng.normal(size=2)),
        rng.normal() * 3,
        rng.normal(size=links - 1) * 60,
    )


class Jet:
    """A function of the curvature with its first two derivatives."""

    def __init__(self, f, d, dd):
        self.f, self.d, self.dd = f, d, dd

    def __add__(self, o):
        return Jet(self.f + o.f, self.d + o.d, self.dd + o.dd)

    def __mul__(self, o):
        return Jet(
            self.f * o.f, self.d * o.f + self.f * o.d, self.dd * o.f + 2 * self.d * o.d + self.f * o.dd
        )


def _arc(s: float, k: np.ndarray, r: float) -> Jet:
    """Displacement along an arc of length s and curvature r k that starts along the real axis."""
    if r == 0:
        return Jet(s + 0j * k, 0j * k, 0j * k)
    c = r * k
    e = np.exp(1j * s * c)
    a = (e - 1) / (1j * c)
    d = (s * e - a) / c
    dd = (1j * s * s * e - 2 * d) / c
    return Jet(a, r * d, r * r * dd)


def _turned(angle_per_k: float, k: np.ndarray) -> Jet:
    e = np.exp(1j * angle_per_k * k)
    return Jet(e, 1j * angle_per_k * e, -(angle_per_k**2) * e)


def segment(body: Body, k: np.ndarray) -> Jet:
    """r_{i+1} - r_i in the axes of link i."""
    half = _arc(body.gap / 2, k, body.ratio)
    middle = _arc(body.l, k, 1.0)
    first, second = _turned(body.ratio * body.gap / 2, k), _turned(body.l, k)
    return half + first * middle + first * second * half


def motion(body: Body, s: State) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Positions and velocities (complex), headings and turn rates of all links."""
    theta = s.heading + np.concatenate([[0], np.cumsum(body.turn * s.kappa)])
    omega = s.heading_rate + np.concatenate([[0], np.cumsum(body.turn * s.dkappa)])
    g = segment(body, s.kappa)
    e = np.exp(1j * theta[:-1])
    step = e * g.f
    step_rate = e * (1j * omega[:-1] * g.f + g.d * s.dkappa)
    r = s.tail + np.concatenate([[0], np.cumsum(step)])
    v = s.tail_rate + np.concatenate([[0], np.cumsum(step_rate)])
    return r, v, theta, omega


def external_forces(robot, s: State) -> np.ndarray:
    """All external forces on the links (complex, room axes), effects as the list of effects defines them."""
    body = Body.of(robot)
    r, v, theta, _ = motion(body, s)
    n = robot.links
    g, vs = robot.gravity_m_s2, robot.friction_speed_m_s
    toe = np.full(n, size(robot, "wheel_toe", "angle"))
    for e in robot.effects:
        if e["name"] == "single_wheel_toe":
            toe[e["link"] - 1] += e["angle"]
    wheel = np.exp(1j * (theta + toe))
    along = v * wheel.conjugate()
    vt, vn = along.real, along.imag
    normal = body.mass * g
    normal[0] += size(robot, "tether_weight", "load_n")
    if robot.friction_law == "per_axis":
        dt, dn = np.tanh(vt / vs), np.tanh(vn / vs)
    else:
        speed = np.sqrt(vt**2 + vn**2 + vs**2)
        dt, dn = vt / speed, vn / speed
    ft = -robot.friction_tangential * normal * dt
    fn = -robot.friction_normal * normal * dn
    stribeck = effect(robot, "stribeck")
    if stribeck:
        ft = ft * (1 + stribeck["excess"] * np.exp(-((vt / stribeck["speed"]) ** 2)))
    fn = fn * (1 + size(robot, "slip_rate", "per_speed") * abs(vn))
    ft = ft - size(robot, "viscous_rolling", "damping") * vt
    f = (ft + 1j * fn) * wheel
    f[0] -= size(robot, "tether_drag", "force_n") * v[0] / np.sqrt(abs(v[0]) ** 2 + vs**2)
    f[0] -= size(robot, "tether_viscous", "damping") * v[0]
    pull = effect(robot, "tether_pull")
    if pull:
        to = complex(pull["ax_m"], pull["ay_m"]) - r[0]
        f[0] += pull["force_n"] * to / abs(to)
    slope = effect(robot, "floor_slope")
    if slope:
        f += body.mass * g * np.sin(slope["angle"]) * np.exp(1j * slope["direction"])
    return f


def cross(a, b):
    return (np.conj(a) * b).imag


def body_state(robot, s: State) -> tuple[np.ndarray, np.ndarray, float]:
    """Pose (x, y, mean heading), (u_x, u_y, turn rate) and angular momentum about the centre of mass."""
    body = Body.of(robot)
    r, v, theta, omega = motion(body, s)
    centre, rate = (body.mass @ r) / body.mass.sum(), (body.mass @ v) / body.mass.sum()
    psi = theta.mean()
    u = rate * np.exp(-1j * psi)
    spin = body.mass @ cross(r - centre, v) + body.inertia * omega.sum()
    return (
        np.array([centre.real, centre.imag, psi]),
        np.array([u.real, u.imag, omega.mean()]),
        float(spin),
    )


def kinetic_energy(robot, s: State) -> float:
    body = Body.of(robot)
    _, v, _, omega = motion(body, s)
    return float(0.5 * body.mass @ abs(v) ** 2 + 0.5 * body.inertia * omega @ omega)


def newton_euler(robot, s: State, ddkappa: np.ndarray) -> dict[str, np.ndarray]:
    """Solve the whole linear system of link accelerations, joint forces, joint and actuator torques.

    Link coordinates r_i, theta_i and the massless segments' kappa_i; the segment between links i and i+1
    carries a force h_i for r_{i+1} - r_i = e(theta_i) G(kappa_i) and a torque q_i for
    theta_{i+1} - theta_i = a kappa_i; the segment's own balance is l T_i = h_i . dr/dkappa + q_i a.
    """
    body = Body.of(robot)
    n, k = robot.links, robot.links - 1
    _, _, theta, omega = motion(body, s)
    g = segment(body, s.kappa)
    e = np.exp(1j * theta[:-1])
    by_theta, by_kappa = 1j * e * g.f, e * g.d
    w, dk = omega[:-1], s.dkappa
    bias = -e * g.f * w**2 + 2j * e * g.d * w * dk + e * g.dd * dk**2 + by_kappa * ddkappa
    f = external_forces(robot, s)
    # unknowns: x'' (n), y'' (n), theta'' (n), h_x (k), h_y (k), q (k), T (k)
    x, y, t = np.arange(n), n + np.arange(n), 2 * n + np.arange(n)
    hx, hy, q, tau = (3 * n + j * k + np.arange(k) for j in range(4))
    a, b = np.zeros((3 * n + 4 * k,) * 2), np.zeros(3 * n + 4 * k)
    row = 0
    for i in range(n):
        for coordinate, h, force in ((x, hx, f.real), (y, hy, f.imag)):
            a[row, coordinate[i]] = body.mass[i]
            if i < k:
                a[row, h[i]] = 1.0  # the segment ahead pulls back
            if i > 0:
                a[row, h[i - 1]] = -1.0
            b[row] = force[i]
            row += 1
        a[row, t[i]] = body.inertia
        if i < k:
            a[row, q[i]] = 1.0
            a[row, hx[i]], a[row, hy[i]] = by_theta[i].real, by_theta[i].imag
        if i > 0:
            a[row, q[i - 1]] = -1.0
        row += 1
    for i in range(k):
        for coordinate, part in ((x, np.real), (y, np.imag)):
            a[row, coordinate[i + 1]], a[row, coordinate[i]] = 1.0, -1.0
            a[row, t[i]] = -part(by_theta[i])
            b[row] = part(bias[i])
            row += 1
        a[row, t[i + 1]], a[row, t[i]] = 1.0, -1.0
        b[row] = body.turn * ddkappa[i]
        row += 1
        a[row, tau[i]] = body.l
        a[row, q[i]] = -body.turn
        a[row, hx[i]], a[row, hy[i]] = -by_kappa[i].real, -by_kappa[i].imag
        row += 1
    # the joint forces' and the torque's sign: h_i and q_i act with + on link i + 1
    scale = np.abs(a).max(axis=1)
    z = np.linalg.solve(a / scale[:, None], b / scale)
    return {
        "acceleration": z[x] + 1j * z[y],
        "angular": z[t],
        "joint": z[hx] + 1j * z[hy],
        "torque": z[tau],
    }


def body_rate(robot, s: State, acceleration: np.ndarray, angular: np.ndarray) -> np.ndarray:
    """Rate of (u_x, u_y, turn rate) from the links' accelerations."""
    body = Body.of(robot)
    pose, u, _ = body_state(robot, s)
    centre = (body.mass @ acceleration) / body.mass.sum()
    du = centre * np.exp(-1j * pose[2]) - 1j * u[2] * complex(u[0], u[1])
    return np.array([du.real, du.imag, angular.mean()])


def lagrangian(links: int) -> ca.Function:
    """(q, q', Q, (l, gap, ratio, J), masses) -> (mass matrix, Q - bias) from the kinetic energy.

    q = (tail x, y, heading, kappa). The chords use differences of sines: good for curvatures away from zero.
    """
    k = links - 1
    q, dq = ca.SX.sym("q", 3 + k), ca.SX.sym("dq", 3 + k)
    force, lengths, mass = ca.SX.sym("Q", 3 + k), ca.SX.sym("lengths", 4), ca.SX.sym("mass", links)
    l, gap, ratio, inertia = (lengths[i] for i in range(4))
    x, y, theta = q[0], q[1], q[2]
    positions, headings = [ca.vertcat(x, y)], [theta]
    for i in range(k):
        c = q[3 + i]
        for s, curvature in ((gap / 2, ratio * c), (l, c), (gap / 2, ratio * c)):
            straight = ca.fabs(curvature) < 1e-9
            safe = ca.if_else(straight, 1.0, curvature)
            end = theta + s * curvature
            x += ca.if_else(straight, s * ca.cos(theta), (ca.sin(end) - ca.sin(theta)) / safe)
            y += ca.if_else(straight, s * ca.sin(theta), (ca.cos(theta) - ca.cos(end)) / safe)
            theta = end
        positions.append(ca.vertcat(x, y))
        headings.append(theta)
    energy = ca.SX(0)
    for i in range(links):
        v = ca.jtimes(positions[i], q, dq)
        energy += 0.5 * mass[i] * ca.dot(v, v) + 0.5 * inertia * ca.jtimes(headings[i], q, dq) ** 2
    momentum = ca.gradient(energy, dq)
    matrix = ca.jacobian(momentum, dq)
    bias = ca.jtimes(momentum, q, dq) - ca.gradient(energy, q)
    place = ca.vertcat(*positions)
    return ca.Function(
        "lagrangian",
        [q, dq, force, lengths, mass],
        [matrix, force - bias, ca.jacobian(place, q), energy],
    )


def lagrangian_motion(robot, function: ca.Function, s: State, ddkappa: np.ndarray) -> dict[str, np.ndarray]:
    """Body accelerations and torques for a wanted kappa'', from the Lagrangian's rows."""
    body = Body.of(robot)
    q = np.concatenate([[s.tail.real, s.tail.imag, s.heading], s.kappa])
    dq = np.concatenate([[s.tail_rate.real, s.tail_rate.imag, s.heading_rate], s.dkappa])
    lengths = [body.l, body.gap, body.ratio, body.inertia]
    f = external_forces(robot, s)
    jac = np.asarray(function(q, dq, 0, lengths, body.mass)[2])
    work = jac.T @ np.stack([f.real, f.imag], axis=1).ravel()
    matrix, right = (np.asarray(v) for v in function(q, dq, work, lengths, body.mass)[:2])
    right = right.ravel()
    free = np.linalg.solve(matrix[:3, :3], right[:3] - matrix[:3, 3:] @ ddkappa)
    torque = (matrix[3:, :3] @ free + matrix[3:, 3:] @ ddkappa - right[3:]) / body.l
    return {"tail": free, "torque": torque}


def accelerations(robot, s: State, tail: np.ndarray, ddkappa: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Links' accelerations from the tail's (x'', y'', theta'') and kappa''."""
    body = Body.of(robot)
    _, _, theta, omega = motion(body, s)
    angular = tail[2] + np.concatenate([[0], np.cumsum(body.turn * ddkappa)])
    g = segment(body, s.kappa)
    e, w, dk = np.exp(1j * theta[:-1]), omega[:-1], s.dkappa
    step = e * ((1j * angular[:-1] - w**2) * g.f + 2j * w * g.d * dk + g.dd * dk**2 + g.d * ddkappa)
    return complex(tail[0], tail[1]) + np.concatenate([[0], np.cumsum(step)]), angular

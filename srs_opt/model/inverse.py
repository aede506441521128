"""Inverse dynamics: the segment torques that a wanted curvature acceleration needs.

This is the paper's feedback linearization: with T chosen this way the curvatures follow any
kappa'', and the body (tail heading, centre-of-mass velocity) is left underactuated. T_i is
conjugate to l kappa_i: the actuators' power is sum T_i l kappa_i'.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca

from srs_opt.model.kinematics import Chain
from srs_opt.model.mechanics import Mechanics
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build


def _link_accelerations(m: Mechanics, ddkappa: ca.SX, u: ca.SX, du: ca.SX, w: ca.SX, dw: ca.SX) -> Chain:
    """Return the links' accelerations in the robot's frame and their angular accelerations.

    `du` is the rate of the frame components, so the centre of mass accelerates by du + w x u.
    """
    c, d = m.chain, m.chain_rate
    a_x, a_y, a_angle = (
        ca.jtimes(rate, m.kappa, m.dkappa) + ca.jtimes(rate, m.dkappa, ddkappa)
        for rate in (d.x, d.y, d.angle)
    )
    # u' + w x u, then relative, Euler, Coriolis and centripetal terms of the turning frame
    x = du[0] - w * u[1] + a_x - dw * c.y - 2 * w * d.y - w**2 * c.x
    y = du[1] + w * u[0] + a_y + dw * c.x + 2 * w * d.x - w**2 * c.y
    return Chain(x, y, dw + a_angle)


@lru_cache(maxsize=16)
def inverse_dynamics(structure: Structure) -> ca.Function:
    """Return ``(kappa, dkappa, ddkappa, pose, velocity, p) -> (torque, velocity_rate)``.

    Virtual power (d'Alembert): l T_i = sum over links of (m a - f) . dr/dkappa_i + J theta'' dtheta/dkappa_i,
    with the complex model's body motion. `velocity` is (u_x, u_y, yaw rate); shapes (N-1,), (3,), (3,).

    Returns
    -------
    casadi.Function
        Torques (N m) and the rate of `velocity`.
    """
    parameters, m, _ = build(Structure("complex", *_rest(structure)))
    pose, velocity = ca.SX.sym("pose", 3), ca.SX.sym("velocity", 3)
    ddkappa = ca.SX.sym("ddkappa", m.links - 1)
    u, w = velocity[:2], velocity[2]
    forces = m.forces(pose, u[0], u[1], w)
    total, moment = m.total_mass(), m.yaw_momentum_rate(forces, w)
    # N m p'' = sum f of (8), seen from the turning frame
    du = ca.vertcat(ca.sum1(forces.x) / total + w * u[1], ca.sum1(forces.y) / total - w * u[0])
    # momentum = I w + a(kappa) kappa'; its rate is the moment
    momentum = m.yaw_inertia() * w + m.yaw_momentum_of_shape()
    drift = ca.jtimes(momentum, m.kappa, m.dkappa) + ca.jtimes(momentum, m.dkappa, ddkappa)
    # drift is the momentum's rate at constant yaw rate
    dw = (moment - drift) / m.yaw_inertia()
    a = _link_accelerations(m, ddkappa, u, du, w, dw)
    generalized = (
        ca.mtimes(ca.jacobian(m.chain.x, m.kappa).T, m.mass * a.x - forces.x)
        + ca.mtimes(ca.jacobian(m.chain.y, m.kappa).T, m.mass * a.y - forces.y)
        + ca.mtimes(ca.jacobian(m.chain.angle, m.kappa).T, m.inertia * a.angle)
    )
    torque = generalized / parameters["segment_length_m"]
    return ca.Function(
        "inverse_dynamics",
        [m.kappa, m.dkappa, ddkappa, pose, velocity, parameters.vector],
        [torque, ca.vertcat(du, dw)],
        ["kappa", "dkappa", "ddkappa", "pose", "velocity", "p"],
        ["torque", "velocity_rate"],
        {"cse": True},
    )


def _rest(structure: Structure) -> tuple[int, str, tuple[str, ...]]:
    return structure.links, structure.friction_law, structure.effects


@lru_cache(maxsize=16)
def forward_dynamics(structure: Structure) -> ca.Function:
    """Return ``(kappa, dkappa, torque, pose, velocity, p) -> (ddkappa, velocity_rate)``.

    The torques are affine in kappa'', so their Jacobian is the shape's mass matrix.
    """
    inverse = inverse_dynamics(structure)
    kappa, dkappa, ddkappa, pose, velocity, p = (
        ca.SX.sym(inverse.name_in(i), inverse.size1_in(i)) for i in range(6)
    )
    torque = ca.SX.sym("torque", kappa.shape[0])
    needed, _ = inverse(kappa, dkappa, ddkappa, pose, velocity, p)
    mass = ca.jacobian(needed, ddkappa)
    # torque = mass kappa'' + torque at kappa'' = 0
    at_zero = ca.substitute(needed, ddkappa, ca.SX.zeros(ddkappa.shape))
    solution = ca.solve(mass, torque - at_zero)
    _, rate = inverse(kappa, dkappa, solution, pose, velocity, p)
    return ca.Function(
        "forward_dynamics",
        [kappa, dkappa, torque, pose, velocity, p],
        [solution, rate],
        ["kappa", "dkappa", "torque", "pose", "velocity", "p"],
        ["ddkappa", "velocity_rate"],
        {"cse": True},
    )


def curvature_controller(
    structure: Structure, natural_frequency_rad_s: float = 60.0, damping: float = 1.0
) -> ca.Function:
    """Return ``(kappa, dkappa, kappa_ref, dkappa_ref, ddkappa_ref, pose, velocity, p) -> torque``.

    Feedback linearization: the wanted acceleration is the reference's plus a second-order error decay
    with the given natural frequency and damping ratio.
    """
    inverse = inverse_dynamics(structure)
    n = structure.segments
    kappa, dkappa, pose, velocity = (ca.SX.sym(s, k) for s, k in (("k", n), ("dk", n), ("pose", 3), ("v", 3)))
    ref, dref, ddref = (ca.SX.sym(s, n) for s in ("ref", "dref", "ddref"))
    p = ca.SX.sym("p", inverse.size1_in(5))
    omega = natural_frequency_rad_s
    wanted = ddref + 2 * damping * omega * (dref - dkappa) + omega**2 * (ref - kappa)
    torque, _ = inverse(kappa, dkappa, wanted, pose, velocity, p)
    return ca.Function("curvature_controller", [kappa, dkappa, ref, dref, ddref, pose, velocity, p], [torque])

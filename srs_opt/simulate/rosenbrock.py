"""One integration step as a CasADi expression: RODAS, order 4(3), L-stable.

The friction is stiff (its rate is about mu_n g / v_s = 2,800 1/s at v_s = 2 mm/s), the shape is
known in closed form, and valves switch only between steps. A linearly implicit method whose
matrix is 3 x 3 (the body's velocity; the pose is eliminated) fits: no iterations, so the step is
one expression that can be mapped over a mesh, differentiated and compiled.

The compliant model, whose bends are stiff too, has a step of its own (`compliant_step`).
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca

from srs_opt.model.actuator import Actuator, ActuatorState
from srs_opt.model.mechanics import Mechanics
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.model.state import BODY_STATES as BODY_STATES
from srs_opt.model.state import POSE as POSE
from srs_opt.model.state import VELOCITY as VELOCITY
from srs_opt.model.state import WORK as WORK
from srs_opt.simulate.compliant_step import compliant_step
from srs_opt.simulate.tableau import COUPLING, GAMMA, LEVER_M, NODES, STAGES, TIME_WEIGHTS


class _BodyField:
    """Right-hand side of pose, velocity and friction work as functions that can be called per stage."""

    def __init__(self, m: Mechanics) -> None:
        pose, velocity = ca.SX.sym("pose", 3), ca.SX.sym("velocity", 3)
        rate, power = m.velocity_rate(pose, velocity)
        pose_rate = m.pose_rate(pose, velocity)
        shape = [m.kappa, m.dkappa]
        p = m.parameters.vector
        body = ca.vertcat(pose_rate, rate, power)
        ddkappa = ca.SX.sym("ddkappa", m.links - 1)
        moving = ca.vertcat(m.kappa, m.dkappa, m.time)
        # the shape is a known function of time, so the field depends on time through it
        in_time = ca.jtimes(body, moving, ca.vertcat(m.dkappa, ddkappa, 1))
        self.value = ca.Function("body", [pose, velocity, *shape, m.time, p], [body])
        self.jacobians = ca.Function(
            "jacobians",
            [pose, velocity, *shape, m.time, ddkappa, p],
            [ca.jacobian(body, pose), ca.jacobian(body, velocity), in_time],
        )


def _inverse3(a: ca.SX) -> ca.SX:
    """Return the inverse of a 3 x 3 matrix by cofactors."""
    # cofactors by cyclic indices need neither signs nor pivoting: an expression without branches
    c = [[a[(i + 1) % 3, (j + 1) % 3] * a[(i + 2) % 3, (j + 2) % 3] for j in range(3)] for i in range(3)]
    d = [[a[(i + 1) % 3, (j + 2) % 3] * a[(i + 2) % 3, (j + 1) % 3] for j in range(3)] for i in range(3)]
    cofactor = ca.vertcat(*[ca.horzcat(*[c[i][j] - d[i][j] for j in range(3)]) for i in range(3)])
    determinant = a[0, 0] * cofactor[0, 0] + a[0, 1] * cofactor[0, 1] + a[0, 2] * cofactor[0, 2]
    return cofactor.T * (1 / determinant)


class _StageSolver:
    """Solves (I/gamma - h J) k = r for the body, h = 0 included; the pose block is eliminated exactly."""

    def __init__(self, by_pose: ca.SX, by_velocity: ca.SX, h: ca.SX) -> None:
        # pose' depends on the pose only through the heading, so its block is nilpotent
        # hence (I/gamma - h A)^-1 = gamma (I + gamma h A), A^2 = 0
        self.lift = GAMMA * (ca.SX.eye(3) + GAMMA * h * by_pose[POSE, :])
        self.pose_by_velocity = h * by_velocity[POSE, :]
        self.velocity_by_pose = h * by_pose[VELOCITY, :]
        self.work_by_pose, self.work_by_velocity = h * by_pose[WORK, :], h * by_velocity[WORK, :]
        matrix = ca.SX.eye(3) / GAMMA - h * by_velocity[VELOCITY, :]
        # Schur complement: what the eliminated pose does to the velocity
        matrix -= self.velocity_by_pose @ self.lift @ self.pose_by_velocity
        self.inverse = _inverse3(ca.densify(matrix))

    def __call__(self, r: ca.SX) -> ca.SX:
        r_pose, r_velocity, r_work = r[POSE], r[VELOCITY], r[WORK]
        k_velocity = self.inverse @ (r_velocity + self.velocity_by_pose @ self.lift @ r_pose)
        k_pose = self.lift @ (r_pose + self.pose_by_velocity @ k_velocity)
        k_work = GAMMA * (r_work + self.work_by_pose @ k_pose + self.work_by_velocity @ k_velocity)
        return ca.vertcat(k_pose, k_velocity, k_work)


@lru_cache(maxsize=32)
def step_function(structure: Structure) -> ca.Function:
    """Return ``step(x, valve, h, p) -> (x_next, error)``: one RODAS step with the valves held.

    `x` holds pose (3), body velocity (3), friction work and the actuators' states; `valve` is (N-1,) in
    [-1, 1], `h` in s (zero is allowed and does nothing), `p` as packed by `Parameters`. `error` is the
    embedded estimate of the local error of the body's velocity, m/s.
    """
    if structure.compliant:
        return compliant_step(structure)
    parameters, mechanics, actuator = build(structure)
    x = ca.SX.sym("x", BODY_STATES + actuator.states)
    valve, h = ca.SX.sym("valve", structure.segments), ca.SX.sym("h")
    body, act = x[:BODY_STATES], actuator.unstack(x[BODY_STATES:])
    field = _BodyField(mechanics)
    shapes = _stage_shapes(actuator, act, valve, h)
    p = parameters.vector
    rates = actuator.rates(act, valve)
    by_pose, by_velocity, in_time = field.jacobians(
        body[POSE], body[VELOCITY], act.kappa, act.dkappa, act.time_s, rates.dkappa, p
    )
    solve = _StageSolver(by_pose, by_velocity, h)
    k: list[ca.SX] = []
    y = body
    for i in range(6):
        # (I/gamma - h J) k_i = h f(y_i) + h^2 g_i df/dt + sum_j c_ij k_j: the transformed form, in which no
        # stage multiplies by J
        if i < 5:
            y = body + sum((a * kj for a, kj in zip(STAGES[i], k)), ca.SX.zeros(BODY_STATES, 1))
        else:  # the embedded third-order result; its difference to the fourth-order one is k_6 itself
            y = y + k[4]
        shape = shapes[NODES[i]]
        r = h * field.value(y[POSE], y[VELOCITY], shape.kappa, shape.dkappa, shape.time_s, p)
        r = r + h * h * TIME_WEIGHTS[i] * in_time
        r = r + sum((c * kj for c, kj in zip(COUPLING[i], k)), ca.SX.zeros(BODY_STATES, 1))
        k.append(solve(r))
    last = shapes[1.0]
    inertia = ca.substitute(mechanics.yaw_inertia(), mechanics.kappa, last.kappa)
    shape_error = ca.SX(0)
    if not actuator.linear:  # no closed form: two half steps are kept, one whole step tells their error
        half = actuator.advance(actuator.advance(act, valve, h / 2), valve, h / 2)
        turn_rate_error = parameters["segment_length_m"] * (half.dkappa - last.dkappa)
        shape_error, last = ca.sumsqr(LEVER_M * turn_rate_error), half
    # yaw momentum to yaw rate to the speed of a point LEVER_M away
    spin_error = LEVER_M * k[5][5] / inertia
    # 1e-30 keeps the root differentiable where nothing moves
    error = ca.sqrt(k[5][3] ** 2 + k[5][4] ** 2 + spin_error**2 + shape_error + 1e-30)
    return ca.Function(
        "step",
        [x, valve, h, p],
        [ca.vertcat(y + k[5], last.vector()), error],
        ["x", "valve", "h", "p"],
        ["x_next", "error"],
        {"cse": True},
    )


def _stage_shapes(
    actuator: Actuator, act: ActuatorState, valve: ca.SX, h: ca.SX
) -> dict[float, ActuatorState]:
    """Return the actuators' states at the stages' times (each from the start of the step)."""
    return {c: actuator.advance(act, valve, c * h) if c else act for c in sorted(set(NODES))}

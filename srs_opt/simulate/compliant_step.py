"""One RODAS step of the compliant model, whose bends are coordinates.

The equations of motion are kept implicit, g(Y, Y', Y'') = 0 (see `srs_opt.model.bending_chain`): RODAS is
stiffly accurate and of full order for such equations of index 1, so no stage inverts the mass matrix. Of the
stages' unknowns (places, velocities, accelerations) all but the velocities are eliminated, which leaves one
matrix of order N + 2 per step, which is factorized in time linear in N (`srs_opt.model.chain_matrix`),

    E = M - h gamma dg/dY' - (h gamma)^2 dg/dY.

Accelerations are continuous (no-load curvature and its rate are, where valves switch) and found afresh at
each step's start. Y stands in the axes of the robot's frame at the step's start.

Source: E. Hairer and G. Wanner, Solving Ordinary Differential Equations II, VI.3-VI.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from srs_opt.geometry import turn_back_by, turn_by
from srs_opt.model.actuator import Actuator, ActuatorState
from srs_opt.model.bending_chain import BendingChain
from srs_opt.model.chain_derivatives import derivatives, mass_matrix
from srs_opt.model.chambers import Chambers, Drive
from srs_opt.model.compliant import CompliantModel
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build, state_layout
from srs_opt.model.state import BODY_STATES, HEADING, POSE, VELOCITY, WORK
from srs_opt.simulate.tableau import COUPLING, GAMMA, LEVER_M, NODES, STAGES, TIME_WEIGHTS


@dataclass(frozen=True)
class _Increment:
    """A stage's increments of Y, Y', h Y'' and the friction work."""

    place: ca.SX
    velocity: ca.SX
    acceleration: ca.SX
    work: ca.SX

    def vector(self) -> ca.SX:
        return ca.vertcat(self.place, self.velocity, self.acceleration, self.work)


def compliant_step(structure: Structure) -> ca.Function:
    """Return ``step(x, valve, h, p) -> (x_next, error)``; see `srs_opt.simulate.rosenbrock.step_function`.

    `error` is the embedded estimate of the links' velocities' local error, weighed by mass (rms), m/s.
    """
    parameters, model, actuator = build(structure)
    assert isinstance(model, CompliantModel)
    layout, p = state_layout(structure), parameters.vector
    x = ca.SX.sym("x", layout.size)
    valve, h = ca.SX.sym("valve", structure.segments), ca.SX.sym("h")
    act = actuator.unstack(x[layout.actuator])
    chain = BendingChain(model)
    to_tail, to_body = _conversions(model)
    y, dy = to_tail(x[VELOCITY], x[layout.kappa], x[layout.dkappa], act.kappa, act.dkappa, p)
    increments, error, end = _stages(chain, y, dy, x[POSE], actuator, act, valve, h)
    n = chain.size
    total = sum((i.vector() for i in increments[1:]), increments[0].vector())
    y, dy = y + total[:n], dy + total[n : 2 * n]
    shape_error = ca.SX(0)
    if not actuator.linear:
        half = actuator.advance(actuator.advance(act, valve, h / 2), valve, h / 2)
        turn_rate_error = parameters["segment_length_m"] * (half.dkappa - end.dkappa)
        shape_error, end = ca.sumsqr(LEVER_M * turn_rate_error), half
    moved, velocity, kappa, dkappa = to_body(y, dy, end.kappa, end.dkappa, p)
    step = ca.vertcat(*turn_by(ca.cos(x[HEADING]), ca.sin(x[HEADING]), moved[0], moved[1]), moved[2])
    pose = x[POSE] + step
    following = ca.vertcat(pose, velocity, x[WORK] + total[-1], kappa, dkappa, end.vector())
    assert following.shape[0] == layout.size >= BODY_STATES
    return ca.Function(
        "step",
        [x, valve, h, p],
        # 1e-30 keeps the root differentiable where nothing moves
        [following, ca.sqrt(error + shape_error + 1e-30)],
        ["x", "valve", "h", "p"],
        ["x_next", "error"],
        {"cse": True},
    )


def _stages(
    chain: BendingChain,
    y: ca.SX,
    dy: ca.SX,
    pose: ca.SX,
    actuator: Actuator,
    act: ActuatorState,
    valve: ca.SX,
    h: ca.SX,
) -> tuple[list[_Increment], ca.SX, ActuatorState]:
    """Return the weighted increments of a step, the squared error estimate and the actuators at its end."""
    n, zero = chain.size, ca.SX.zeros(chain.size, 1)
    shapes = {c: actuator.advance(act, valve, c * h) if c else act for c in sorted(set(NODES))}

    def drive(at: ActuatorState) -> Drive:
        return Drive(at.kappa, at.dkappa, pose, actuator.rates(at, valve).dkappa, at.time_s)

    start = drive(act)
    # g = force - M Y'': at Y'' = 0 it is the right-hand side of M Y'' = force
    force, power = chain.residual(y, dy, zero, start, ca.SX(1))
    acceleration = mass_matrix(chain, y, start).solver()(force)
    jacobian = derivatives(chain, y, dy, acceleration, start)
    in_time, power_in_time = chain.rate_in_time(y, dy, acceleration, start, actuator.jerk(act, valve))
    acceleration = h * acceleration
    step = h * GAMMA
    # E of the module's description, factorized once for all six stages
    solve = jacobian.mass.plus(jacobian.by_rate, -step).plus(jacobian.by_place, -(step**2)).solver()
    k: list[_Increment] = []
    # the embedded result is the fifth stage's point plus k_5
    last: tuple[float, ...] = (*STAGES[4], 1.0)
    for i in range(6):  # as in `rosenbrock.step_function`, places and accelerations eliminated
        weights = STAGES[i] if i < 5 else last
        at = _combined(weights, k, n)
        if i:
            residual, power = chain.residual(
                y + at.place, dy + at.velocity, acceleration + at.acceleration, drive(shapes[NODES[i]]), h
            )
        else:
            # the accelerations at the start were solved for: g = 0 there
            residual, power = zero, h * power
        coupled = _combined(COUPLING[i], k, n)
        r_place = h * (dy + at.velocity) + coupled.place
        r_velocity = acceleration + at.acceleration + coupled.velocity
        # the residual is h g already; its rate in time takes h once more
        right = residual + h * h * TIME_WEIGHTS[i] * in_time
        right += jacobian.mass.times(r_velocity) + step * jacobian.by_place.times(r_place)
        # from the velocity's increment those of place and h Y'' follow without a further system
        velocity = solve(GAMMA * right)
        place = GAMMA * (r_place + h * velocity)
        work = (
            power + coupled.work + h * (jacobian.power_by_rate @ velocity + jacobian.power_by_place @ place)
        )
        work += h * h * TIME_WEIGHTS[i] * power_in_time
        k.append(_Increment(place, velocity, velocity / GAMMA - r_velocity, GAMMA * work))
    # stiffly accurate: k_6 is the difference of the fourth- and the third-order result
    error = k[5].velocity
    squared = error.T @ jacobian.mass.times(error) / chain.model.total_mass()
    return [_scaled(w, i) for w, i in zip((*last, 1.0), k)], squared, shapes[1.0]


def _combined(weights: tuple[float, ...], k: list[_Increment], n: int) -> _Increment:
    total = _Increment(ca.SX.zeros(n, 1), ca.SX.zeros(n, 1), ca.SX.zeros(n, 1), ca.SX(0))
    for weight, increment in zip(weights, k):
        part = _scaled(weight, increment)
        total = _Increment(
            total.place + part.place,
            total.velocity + part.velocity,
            total.acceleration + part.acceleration,
            total.work + part.work,
        )
    return total


def _scaled(weight: float, i: _Increment) -> _Increment:
    return _Increment(weight * i.place, weight * i.velocity, weight * i.acceleration, weight * i.work)


def _conversions(model: CompliantModel) -> tuple[ca.Function, ca.Function]:
    """Return (velocity, kappa, dkappa, free, p) -> (Y, Y') and the way back.

    The way back is (Y, Y', free, p) -> (moved, velocity, kappa, dkappa); `free` are the no-load curvatures
    and their rates. Y stands in the robot's frame at the step's start; `moved` is the pose (3,) in it.
    """
    p, free = model.parameters.vector, (model.no_load, model.no_load_rate)
    kappa, dkappa, velocity = model.kappa, model.dkappa, ca.SX.sym("velocity", 3)
    c, d, yaw_rate = model.chain, model.chain_rate, model.yaw_rate(velocity[2])
    v = model.link_velocities(velocity[0], velocity[1], yaw_rate)
    to_tail = ca.Function(
        "to_tail",
        [velocity, kappa, dkappa, *free, p],
        [ca.vertcat(c.x[0], c.y[0], c.angle), ca.vertcat(v.x[0], v.y[0], v.angle)],
        {"cse": True},
    )
    w = ca.SX.sym("w")
    body = ca.Function(
        "body",
        [kappa, dkappa, w, *free, p],
        [
            ca.vertcat(c.x[0], c.y[0]),
            ca.vertcat(d.x[0] - w * c.y[0], d.y[0] + w * c.x[0]),
            model.yaw_inertia() * w + model.yaw_momentum_of_shape(),
        ],
        {"cse": True},
    )
    n = model.links
    y, dy = ca.SX.sym("y", n + 2), ca.SX.sym("dy", n + 2)
    chambers = Chambers.of(model, Drive(*free, ca.SX.zeros(3, 1), model.no_load_acceleration))
    bend, rate = chambers.kappa(y), chambers.dkappa(y, dy)
    turn, spin = ca.sum1(y[2:]) / n, ca.sum1(dy[2:]) / n
    # the centre of mass is the tail less its place in the body, with rates likewise
    tail, tail_rate, momentum = body(bend, rate, spin, *free, p)
    cos, sin = ca.cos(turn), ca.sin(turn)
    tail_x, tail_y = turn_by(cos, sin, tail[0], tail[1])
    moved = ca.vertcat(y[0] - tail_x, y[1] - tail_y, turn)
    along, across = turn_back_by(cos, sin, dy[0], dy[1])
    speed = ca.vertcat(along - tail_rate[0], across - tail_rate[1], momentum)
    to_body = ca.Function("to_body", [y, dy, *free, p], [moved, speed, bend, rate], {"cse": True})
    return to_tail, to_body

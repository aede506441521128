"""The equations at one collocation point, with exact Jacobian and Hessian, compiled once per structure.

The motion is written about its own mean: the frame that travels along the mean path (an arc of
curvature turn_rate/speed, a line when that is zero) at the mean speed. In it every state repeats after
one cycle, straight gaits and turns obey the same smooth equations, and speed and turn rate are plain
unknowns:

    heading' = yaw rate - turn_rate
    ahead'   = (R(heading) u)_x - speed + turn_rate * aside
    aside'   = (R(heading) u)_y - turn_rate * ahead

with the means of `ahead` and `aside` zero. The body's velocity u and yaw momentum follow the model; the
curvature is known in closed form. Effects that make the actuators nonlinear add their *deviation* from
the closed form as states, so that valve switches still need no mesh point.

In the compliant model this curvature is that without load; the bends and their rates are states too.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import casadi as ca

from srs_opt.gait_opt.collocation.bending import bend_acceleration
from srs_opt.geometry import turn_by
from srs_opt.model.actuator import Actuator, ActuatorState
from srs_opt.model.actuator_law import acceleration, periodic_curvature, time_constants
from srs_opt.model.compliant import CompliantModel
from srs_opt.model.kinematics import segment_sagitta
from srs_opt.model.mechanics import Mechanics
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.simulate.compiled import FLAGS, compiled

# the body's states at a point: velocity, then the pose in the frame that goes along the mean path
U_X, U_Y, YAW_MOMENTUM, HEADING, AHEAD, ASIDE = range(6)
VELOCITY, BODY = slice(0, 3), 6
BODY_NAMES = (
    "forward velocity",
    "sideways velocity",
    "yaw momentum",
    "heading",
    "place ahead",
    "place aside",
)
# -O1 compiles the Hessian a third longer and gains 4 % of its running time; with -O0 it takes four times as
# long to run
LIGHT = ("-Og", *FLAGS[1:])
QUADRATURES = 3  # mean ahead, mean aside, friction work


@dataclass(frozen=True)
class PointKind:
    """What fixes the equations of a collocation point.

    Attributes
    ----------
    structure : Structure
    intervals : int
        On-intervals K per segment.
    ordered : bool
        Whether the switch order is given (times then enter smoothly) or follows from the times.
    envelope, curvature : bool
        Whether the rows "body's lateral reach" and "curvature" are there.
    relaxed : bool
        Whether valves are levels in [-1, 1], one per element and segment, in place of switch times; the
        actuators are states then.
    """

    structure: Structure
    intervals: int = 1
    ordered: bool = False
    envelope: bool = False
    curvature: bool = False
    relaxed: bool = False

    @property
    def segments(self) -> int:
        """Number of segments."""
        return self.structure.segments

    @property
    def switches(self) -> int:
        """Number of switch times (relaxed: valve levels) that a point depends on."""
        return self.segments if self.relaxed else 2 * self.intervals * self.segments

    @property
    def bends(self) -> int:
        """Number of states of the bends, curvatures and their rates: none where they are prescribed."""
        return 2 * self.segments if self.structure.compliant else 0

    @property
    def moving(self) -> int:
        """Number of states of body and bends; those of the actuators follow."""
        return BODY + self.bends

    @property
    def states(self) -> int:
        """Number of states."""
        actuator = build(self.structure)[2]
        return self.moving + (0 if actuator.linear and not self.relaxed else actuator.states)

    @property
    def paths(self) -> int:
        """Number of path rows: lateral reach of links and arc middles, then curvatures."""
        reach = 2 * self.structure.links - 1 if self.envelope else 0
        return reach + (self.segments if self.curvature else 0)

    @property
    def locals(self) -> int:
        """Number of local unknowns: states, speed, turn rate, frequency, pressure, switches, place, width."""
        return self.states + 4 + self.switches + 2

    @property
    def outputs(self) -> int:
        """Number of outputs: state rates times the element's duration, quadratures, path rows."""
        return self.states + QUADRATURES + self.paths


@dataclass(frozen=True)
class _Symbols:
    x: ca.SX
    speed: ca.SX
    turn_rate: ca.SX
    frequency: ca.SX
    pressure: ca.SX
    switches: ca.SX
    at: ca.SX
    width: ca.SX
    scale: ca.SX
    turns: ca.SX
    half_width: ca.SX

    @staticmethod
    def of(kind: PointKind) -> _Symbols:
        names = ("speed", "turn_rate", "frequency", "pressure")
        speed, turn_rate, frequency, pressure = (ca.SX.sym(n) for n in names)
        return _Symbols(
            ca.SX.sym("x", kind.states), speed, turn_rate, frequency, pressure,
            ca.SX.sym("switches", kind.switches), ca.SX.sym("at"), ca.SX.sym("width"),
            ca.SX.sym("scale", kind.states), ca.SX.sym("turns", kind.switches), ca.SX.sym("half_width"),
        )  # fmt: skip

    def unknowns(self) -> ca.SX:
        return ca.vertcat(
            self.x,
            self.speed,
            self.turn_rate,
            self.frequency,
            self.pressure,
            self.switches,
            self.at,
            self.width,
        )


def _linear_curvature(kind: PointKind, s: _Symbols) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return the closed-form curvatures, their rates and the valves, (N-1, 1) each (none when relaxed)."""
    if kind.relaxed:
        return ca.SX(0, 1), ca.SX(0, 1), ca.SX(0, 1)
    parameters, _, actuator = build(kind.structure)
    ones = ca.SX.ones(kind.segments, 1)
    high, low = actuator.target(ones), actuator.target(-ones)
    command = ca.SX.sym("command", kind.segments)
    by_command = ca.substitute(ca.jacobian(actuator.target(command), command), command, 0 * ones)
    coupled = not ca.SX(by_command).sparsity().is_diag()  # segments that also follow others' valves
    middle = (high + low) / 2
    if coupled:  # the actuators are linear: what each valve does adds up
        high, low = ones, -ones
    k = kind.intervals
    columns = []
    for i in range(kind.segments):
        mine = slice(2 * k * i, 2 * k * (i + 1))
        pair = (s.switches[mine][:k], s.switches[mine][k:])
        turns = s.turns[mine] if kind.ordered else None
        columns.append(periodic_curvature(parameters, high[i], low[i], s.at, pair, s.half_width, turns))
    kappa, rate, valve = (ca.vertcat(*[c[j] for c in columns]) for j in range(3))
    if coupled:
        kappa, rate = middle + by_command @ kappa, by_command @ rate
    return kappa, rate, valve


def _shape(
    kind: PointKind, actuator: Actuator, s: _Symbols, closed: ca.SX, deviation: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return curvatures, rates, accelerations, and the rates of the deviation from the closed form.

    `closed` stacks what `_linear_curvature` returns. Relaxed, the actuators' states are
    collocated themselves.
    """
    if kind.relaxed:
        own = actuator.unstack(deviation)
        rates = actuator.rates(own, s.switches)
        return own.kappa, own.dkappa, rates.dkappa, rates.vector()
    kappa, dkappa, valve = ca.vertsplit(closed, kind.segments)
    # the same spread time constants as in the closed form, or the deviation would not vanish
    tau1, tau2 = time_constants(actuator.parameters)
    linear = acceleration(actuator.target(valve), kappa, dkappa, tau1, tau2)
    if actuator.linear:
        return kappa, dkappa, linear, ca.SX(0, 1)
    away = actuator.unstack(deviation)
    state = ActuatorState(kappa + away.kappa, dkappa + away.dkappa, away.memory)
    full = actuator.rates(state, valve)
    rates = ca.vertcat(away.dkappa, full.dkappa - linear, *full.memory)
    return state.kappa, state.dkappa, full.dkappa, rates


def _lateral_reach(m: Mechanics, heading: ca.SX, ahead: ca.SX, aside: ca.SX, curvature: ca.SX) -> ca.SX:
    """Return how far links and arc middles lie left of the mean path of that curvature, (2 N - 1, 1) m."""
    chain, length = m.chain, m.length
    xs, ys = [chain.x], [chain.y]
    for i in range(m.links - 1):
        chord = ca.vertcat(chain.x[i + 1] - chain.x[i], chain.y[i + 1] - chain.y[i])
        sagitta = segment_sagitta(m.kappa[i], length[i], m.gap_length, m.gap_ratio)
        norm = ca.sqrt(ca.dot(chord, chord))
        # the arc's middle lies right of the chord's by the sagitta (kappa > 0: bent to the left)
        xs.append((chain.x[i] + chain.x[i + 1]) / 2 + sagitta * chord[1] / norm)
        ys.append((chain.y[i] + chain.y[i + 1]) / 2 - sagitta * chord[0] / norm)
    x, y = ca.vertcat(*xs), ca.vertcat(*ys)
    dx, dy = turn_by(ca.cos(heading), ca.sin(heading), x, y)
    room_x, room_y = ahead + dx, aside + dy
    # distance to the centre of rotation minus the radius, in a form that is regular for a straight path
    distance = ca.sqrt((curvature * room_x) ** 2 + (1 - curvature * room_y) ** 2)
    return (2 * room_y - curvature * (room_x**2 + room_y**2)) / (1 + distance)


def _filled(kind: PointKind, s: _Symbols, p: ca.SX, expression: ca.SX) -> ca.SX:
    """Return the expression with the numbers of `p`, pressure and frequency the unknowns."""
    parameters = build(kind.structure)[0]
    place = parameters.names.index("pressure_kpa")
    filled = ca.vertcat(p[:place], s.pressure, s.frequency, p[place + 2 :])
    return ca.substitute(expression, parameters.vector, filled)


def _equations(kind: PointKind, s: _Symbols, p: ca.SX, closed: ca.SX) -> ca.SX:
    _, m, actuator = build(kind.structure)
    x = s.scale * s.x
    velocity, heading, ahead, aside = x[VELOCITY], x[HEADING], x[AHEAD], x[ASIDE]
    free, free_rate, free_acceleration, deviation_rate = _shape(kind, actuator, s, closed, x[kind.moving :])
    body_rate, power = m.velocity_rate(ca.SX.zeros(3, 1), velocity)
    yaw_rate = m.yaw_rate(x[YAW_MOMENTUM])
    v_x, v_y = turn_by(ca.cos(heading), ca.sin(heading), x[U_X], x[U_Y])
    given = [(m.dkappa, free_rate), (m.kappa, free)]
    bend_rates = ca.SX(0, 1)
    if isinstance(m, CompliantModel):
        kappa, dkappa = ca.vertsplit(x[BODY : kind.moving], kind.segments)
        bend_rates = ca.vertcat(dkappa, bend_acceleration(m, velocity, heading))
        given = [(m.no_load_acceleration, free_acceleration), (m.no_load_rate, free_rate), (m.no_load, free)]
        given += [(m.dkappa, dkappa), (m.kappa, kappa)]
    rates = ca.vertcat(
        body_rate,
        yaw_rate - s.turn_rate,
        v_x - s.speed + s.turn_rate * aside,
        v_y - s.turn_rate * ahead,
        bend_rates,
        deviation_rate,
    )
    duration = s.width / s.frequency
    # the means of `ahead` and `aside`, which fix the frame, and the work
    quadratures = ca.vertcat(s.width * s.x[AHEAD], s.width * s.x[ASIDE], duration * power)
    paths = []
    if kind.envelope:
        paths.append(_lateral_reach(m, heading, ahead, aside, s.turn_rate / s.speed))
    if kind.curvature:
        paths.append(m.kappa)
    # per element and in the states' scales: rows of defects are of order one
    out = ca.vertcat(duration * rates / s.scale, quadratures, *paths)
    for old, new in given:
        out = ca.substitute(out, old, new)
    return _filled(kind, s, p, out)


@lru_cache(maxsize=1)
def _sources() -> str:
    folder = Path(__file__).parent
    digest = hashlib.sha256()
    for name in ("bending.py", "point.py"):
        digest.update((folder / name).read_bytes())
    return digest.hexdigest()[:16]


@dataclass(frozen=True)
class PointFunctions:
    """Compiled ``value(y, scale, p, half_width, turns)``, ``jacobian(...)`` and
    ``hessian(y, scale, p, half_width, turns, multipliers)`` (its lower triangle), with sparsities."""

    value: ca.Function
    jacobian: ca.Function
    hessian: ca.Function
    jacobian_sparsity: ca.Sparsity
    hessian_sparsity: ca.Sparsity


@lru_cache(maxsize=32)
def point_functions(kind: PointKind) -> PointFunctions:
    """Return the point's equations and derivatives, compiled and cached on disk by content."""

    def make(what: str) -> ca.Function:
        s = _Symbols.of(kind)
        p = ca.SX.sym("p", build(kind.structure)[0].vector.numel())
        curvature = _filled(kind, s, p, ca.vertcat(*_linear_curvature(kind, s)))
        closed = ca.SX.sym("closed", curvature.numel())
        y, out = s.unknowns(), _equations(kind, s, p, closed)
        inputs = [y, s.scale, p, s.half_width, s.turns]

        def function(expression: ca.SX, *more: ca.SX) -> ca.Function:
            # differentiated by the curvature as a symbol, filled in last
            known = ca.substitute(expression, closed, curvature)
            return ca.Function(what, [*inputs, *more], [known], {"cse": True})

        if what == "value":
            return function(out)
        # each curvature depends on few of the unknowns: the chain rule halves the operations
        inner = ca.jacobian(curvature, y)
        if what == "jacobian":
            return function(ca.jacobian(out, y) + ca.jacobian(out, closed) @ inner)
        multipliers = ca.SX.sym("multipliers", out.numel())
        merit = ca.dot(multipliers, out)
        both, gradient = ca.hessian(merit, ca.vertcat(y, closed))
        n = y.numel()
        # second derivatives of f(y, c(y)): f_yy + f_yc c' + (f_yc c')^T + c'^T f_cc c' + f_c c''
        mixed = both[:n, n:] @ inner
        weights = ca.SX.sym("weights", closed.numel())
        curved = ca.substitute(ca.hessian(ca.dot(weights, curvature), y)[0], weights, gradient[n:])
        return function(
            ca.tril(both[:n, :n] + mixed + mixed.T + inner.T @ both[n:, n:] @ inner + curved), multipliers
        )

    value, jacobian, hessian = (
        compiled(
            f"gait_opt {what} {kind} {_sources()}",
            partial(make, what),
            FLAGS if what == "value" else LIGHT,
        )
        for what in ("value", "jacobian", "hessian")
    )
    return PointFunctions(value, jacobian, hessian, jacobian.sparsity_out(0), hessian.sparsity_out(0))


@lru_cache(maxsize=32)
def linear_shape(kind: PointKind, points: int) -> ca.Function:
    """Return ``(switches, frequency, pressure, at (1, points), p, half_width) -> (kappa, dkappa)``.

    Both are (N-1, points).
    """
    s = _Symbols.of(kind)
    p = ca.SX.sym("p", build(kind.structure)[0].vector.numel())
    shapes = [_filled(kind, s, p, v) for v in _linear_curvature(kind, s)[:2]]
    single = ca.Function(
        "shape", [s.switches, s.frequency, s.pressure, s.at, p, s.half_width], shapes, {"cse": True}
    )
    return single.map("shapes", "serial", points, [0, 1, 2, 4, 5], [])

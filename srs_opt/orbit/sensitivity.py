"""Derivatives of a steady gait's speed and turn rate by robot and gait, from one pass over its orbit.

The orbit is a fixed point z = G(z, q) of one period, z the velocity and the actuators, q a parameter; so
dz/dq = (I - dG/dz)^-1 dG/dq. All columns are tangents of the integration itself, several in each call of
the compiled code. Moving the switch of one valve by dt changes the state right after it by
[f(valve before) - f(valve after)] dt and nothing else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from srs_opt.gait import Wave
from srs_opt.model.parameters import GAIT_PARAMETERS, Structure
from srs_opt.model.registry import build
from srs_opt.orbit.body import integrator
from srs_opt.orbit.period_map import tangent_kernel
from srs_opt.orbit.steady import Orbit
from srs_opt.robot import Robot
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.kernel import LANES, Course

_TINY = 1e-30  # of the complex step


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of (speed m/s, turn rate rad/s) per unit of each parameter; arrays are (2,) each.

    Attributes
    ----------
    robot : dict
        By the model's parameters (``friction_normal``, ``tau1_s``, ``0.tether_drag.force_n`` ...).
    pressure_kpa, period_s : arrays (2,)
        The period stretches the whole valve timing.
    switches : tuple per segment of tuples per interval of (by on_s, by off_s)
        Each switch moved alone, in s.
    """

    robot: dict[str, np.ndarray]
    pressure_kpa: np.ndarray
    period_s: np.ndarray
    switches: tuple[tuple[tuple[np.ndarray, np.ndarray], ...], ...]

    def of_wave(self, wave: Wave) -> dict[str, np.ndarray]:
        """Return the derivatives by the parameters of the valve wave (13) that the gait was made from.

        Keys ``frequency_hz`` and ``pressure_kpa`` (2,), ``phase_rad`` and ``offset`` (N-1, 2).
        """
        omega = 2 * math.pi * wave.frequency_hz
        edges = [intervals[0] for intervals in self.switches]
        # (13) switches at omega t_on = -beta - asin(phi) and omega t_off = pi - beta + asin(phi)
        opening = [1 / (omega * math.sqrt(1 - phi**2)) for phi in wave.offset]
        return {
            "frequency_hz": -self.period_s / wave.frequency_hz**2,
            "pressure_kpa": self.pressure_kpa,
            "phase_rad": np.array([-(on + off) / omega for on, off in edges]),
            "offset": np.array([(off - on) * jacobian for (on, off), jacobian in zip(edges, opening)]),
        }


@dataclass(frozen=True)
class _Direction:
    """A tangent to follow: where it starts, what it changes, and how the time axis stretches with it."""

    first: int  # step before which it begins
    dx: np.ndarray
    dp: np.ndarray
    stretch: float = 0.0  # relative change of every step


def sensitivity(robot: Robot, orbit: Orbit, model: str | None = None) -> Sensitivity:
    """Return the derivatives of a steady gait's speed and turn rate.

    Parameters
    ----------
    orbit : Orbit
        Of `robot` and `model`, from `srs_opt.orbit.steady.steady_gait`.
    """
    run, gait = integrator(robot, model), orbit.gait
    names = run.parameters.names
    nx, count = run.states, len(names)
    p = run.pack(gait.pressure_kpa, gait.frequency_hz)
    free = run.layout.periodic
    start = [_Direction(0, np.eye(nx)[i], np.zeros(count)) for i in free]
    by_parameter = [_Direction(0, np.zeros(nx), row) for row in np.eye(count)]
    # df/dT = -f^2: effects that depend on the frequency feel a longer period, too
    longer = np.where([n == "frequency_hz" for n in names], -(gait.frequency_hz**2), 0.0)
    longer_period = _Direction(0, np.zeros(nx), longer, 1 / gait.period_s)
    moved = [_moved_switch(run, orbit, p, s, t) for s, pairs in enumerate(gait.intervals) for on_off in pairs
             for t in on_off]  # fmt: skip
    asked = [*by_parameter, longer_period, *moved]
    tangents = _follow(run, orbit, p, [*start, *asked])
    by_start, direct = tangents[: len(free)], tangents[len(free) :]
    # (I - dG/dz)^-1; tangents are rows here, columns of dG/dz there
    closing = np.linalg.inv(np.eye(len(free)) - by_start[:, -1, free].T)
    derivatives = []
    for direction, own in zip(asked, direct):
        dz = closing @ own[-1, free]
        # the direct change of the orbit and that of its start, which must repeat
        path = own + np.tensordot(dz, by_start, axes=1)
        derivatives.append(_motion_derivative(orbit, path[:, :3], direction.stretch))
    switches = iter(derivatives[count + 1 :])
    return Sensitivity(
        robot={n: d for n, d in zip(names, derivatives) if n not in GAIT_PARAMETERS},
        pressure_kpa=derivatives[names.index("pressure_kpa")],
        period_s=derivatives[count],
        switches=tuple(tuple((next(switches), next(switches)) for _ in pairs) for pairs in gait.intervals),
    )


def _moved_switch(run: Integrator, orbit: Orbit, p: np.ndarray, segment: int, at_s: float) -> _Direction:
    """Return the tangent of moving to later the switch of one segment's valve at `at_s`."""
    # steps end at switches, so that one stands on a node but for rounding
    node = int(np.argmin(abs(orbit.time_s - at_s)))
    if node == orbit.time_s.size - 1:  # the end of the period is its start
        node = 0
    solution = orbit.solution
    state = solution.start if node == 0 else solution.states[:, node - 1]
    after = solution.valve[:, solution.mesh.phase[node]].copy()
    before = after.copy()
    # a gait's valves stand left or right, nothing else
    before[segment] = -after[segment]
    rates = actuator_rates(run.structure)
    jump = [np.asarray(rates(state[run.layout.actuator], v, p)).ravel() for v in (before, after)]
    dx = np.zeros(run.states)
    dx[run.layout.actuator] = jump[0] - jump[1]
    return _Direction(node, dx, np.zeros(p.size))


def _follow(run: Integrator, orbit: Orbit, p: np.ndarray, directions: list[_Direction]) -> np.ndarray:
    """Return the tangents at the nodes, (directions, nodes, nx)."""
    solution, nx = orbit.solution, run.states
    states = np.concatenate([solution.start[:, None], solution.states], axis=1)
    h_s, valve = solution.mesh.h_s, solution.valve.T[solution.mesh.phase]
    kernel = tangent_kernel(run.structure)
    tangents = np.zeros((len(directions), h_s.size + 1, nx))
    order = sorted(range(len(directions)), key=lambda k: directions[k].first)  # alike lengths share a call
    for k in range(0, len(order), LANES):
        group = order[k : k + LANES]
        courses = []
        for d in (directions[i] for i in group):
            h = h_s[d.first :]
            inputs = np.column_stack([valve[d.first :], d.stretch * h])
            courses.append(Course(np.r_[states[:, d.first], d.dx], h, inputs, np.r_[p, d.dp]))
        found, _ = kernel.run(courses)
        for lane, i in enumerate(group):
            first = directions[i].first
            tangents[i, first] = directions[i].dx
            tangents[i, first + 1 :] = found[: h_s.size - first, nx:, lane]
    return tangents


def _motion_derivative(orbit: Orbit, path: np.ndarray, stretch: float) -> np.ndarray:
    """Return the change of (speed, turn rate) for a change `path` (n, 3) of the poses, by a complex step."""
    # complex step: exact to rounding as all below is analytic (no hypot, no atan2, no absolute value)
    step = 1j * _TINY
    time = orbit.time_s * (1 + step * stretch)
    x, y, heading = (orbit.pose + step * path).T
    dx, dy, turn, period = x[-1] - x[0], y[-1] - y[0], heading[-1] - heading[0], time[-1] - time[0]
    if orbit.radius_m is None:
        speed = np.sqrt(dx**2 + dy**2) / period * np.sign(orbit.speed_m_s)
    else:
        half = np.cos(turn / 2) / np.sin(turn / 2)
        across = x - x[0] - (dx - half * dy) / 2, y - y[0] - (dy + half * dx) / 2
        distance = np.sqrt(across[0] ** 2 + across[1] ** 2)
        mean = np.sum((distance[1:] + distance[:-1]) / 2 * np.diff(time)) / period
        speed = mean * turn / period * np.sign(orbit.speed_m_s * orbit.turn_rate_rad_s)
    return np.array([speed.imag, (turn / period).imag]) / _TINY


@lru_cache(maxsize=32)
def actuator_rates(structure: Structure) -> ca.Function:
    """Return ``rates(act, valve, p)``: the time derivative of the actuators' states."""
    parameters, _, actuator = build(structure)
    act, valve = ca.SX.sym("act", actuator.states), ca.SX.sym("valve", structure.segments)
    rates = actuator.rates(actuator.unstack(act), valve).vector()
    return ca.Function("rates", [act, valve, parameters.vector], [rates], {"cse": True})

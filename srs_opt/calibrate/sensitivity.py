"""Derivatives of a trial's motion by any coordinates: the variational equations on the mesh's nodes.

The Jacobians of the equations of motion come from CasADi, at all nodes in one call; the linear equations
are solved with an L-stable scheme of order 2 (Pade (0, 2)), for all trials of a batch together. Delays
need none of this: they shift the motion in time, so their derivative is minus the velocity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from srs_opt.calibrate.nominal import Nodes, with_memory
from srs_opt.calibrate.start import start_pose
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.simulate.buffered import buffered
from srs_opt.simulate.compiled import compiled

MAP = 64  # nodes per call of the compiled functions


@lru_cache(maxsize=8)
def _body_slopes(structure: Structure) -> ca.Function:
    """Return ``(body (6), kappa, dkappa, p) -> (rate (6), d/d body, d/d (kappa, dkappa), d/d p)``, mapped."""

    def make() -> ca.Function:
        parameters, m, _ = build(structure)
        body = ca.SX.sym("body", 6)
        rate, _ = m.velocity_rate(body[:3], body[3:])
        field = ca.vertcat(m.pose_rate(body[:3], body[3:]), rate)
        shape = ca.vertcat(m.kappa, m.dkappa)
        p = parameters.vector
        outputs = [field, *(ca.densify(ca.jacobian(field, v)) for v in (body, shape, p))]
        outputs = [ca.reshape(o, -1, 1) for o in outputs]
        single = ca.Function("slopes", [body, m.kappa, m.dkappa, p], outputs, {"cse": True})
        return mapped(single, (3,))

    return compiled(f"body slopes {MAP} {structure}", make)


@lru_cache(maxsize=8)
def _actuator_slopes(structure: Structure) -> ca.Function:
    """Return ``(states, valve, p) -> (rates of dkappa, z by the states; by p)``, mapped.

    States are kappa, dkappa and, where hysteresis can act, z.
    """

    def make() -> ca.Function:
        from srs_opt.model.actuator import ActuatorState

        parameters, _, actuator = build(structure)
        n = structure.segments
        states = [ca.SX.sym(f"state{k}", n) for k in range(2 + actuator.memories)]
        valve = ca.SX.sym("valve", n)
        rates = actuator.rates(ActuatorState(states[0], states[1], tuple(states[2:])), valve)
        field = ca.vertcat(rates.dkappa, *rates.memory)
        own = [ca.horzcat(*[_diagonal(rate, v) for v in states]) for rate in ca.vertsplit(field, n)]
        by_p = ca.densify(ca.jacobian(field, parameters.vector))
        outputs = [ca.reshape(o, -1, 1) for o in (ca.vertcat(*own), by_p)]
        single = ca.Function("act", [*states, valve, parameters.vector], outputs, {"cse": True})
        return mapped(single, (len(states) + 1,))

    return compiled(f"actuator slopes {MAP} {structure}", make)


def _diagonal(field: ca.SX, by: ca.SX) -> ca.SX:
    return ca.densify(ca.diag(ca.jacobian(field, by)))


def mapped(single: ca.Function, repeated: tuple[int, ...]) -> ca.Function:
    """Map a function over MAP nodes with some inputs the same for all."""
    inputs = [
        ca.MX.sym(single.name_in(i), single.size1_in(i), 1 if i in repeated else MAP)
        for i in range(single.n_in())
    ]
    full = [ca.repmat(v, 1, MAP) if i in repeated else v for i, v in enumerate(inputs)]
    return ca.Function("mapped", inputs, single.map(MAP).call(full))


def evaluate(function: ca.Function, moving: tuple[np.ndarray, ...], *fixed: np.ndarray) -> list[np.ndarray]:
    """Evaluate a mapped function at all rows of `moving`; outputs have one row per node."""
    call = buffered(function)
    for argument, value in zip(call.arguments[len(moving) :], fixed):
        argument[0] = value
    n = moving[0].shape[0]
    out = [np.empty((n, result.shape[1])) for result in call.results]
    for k in range(0, n, MAP):
        count = min(MAP, n - k)
        for argument, value in zip(call.arguments, moving):
            argument[:count] = value[k : k + count]
        call.evaluate()
        for whole, part in zip(out, call.results):
            whole[k : k + count] = part[:count]
    return out


@dataclass(frozen=True)
class Variation:
    """Sensitivities of one trial at its nodes.

    Attributes
    ----------
    pose : array (nodes, 3, K)
    kappa : array (nodes, N-1, K)
    """

    pose: np.ndarray
    kappa: np.ndarray


def _decay(a: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Return (I - hA + (hA)^2/2)^-1 for a stack of matrices."""
    z = a * h[..., None, None]
    return np.linalg.inv(np.eye(a.shape[-1]) - z + z @ z / 2)


def _forcing(a: np.ndarray, h: np.ndarray, b0: np.ndarray, b1: np.ndarray) -> np.ndarray:
    """Return h [(1/2 - hA/6) b0 + (1/2 - hA/3) b1]: the forcing of a step, linear in time."""
    hh = h[..., None, None]
    return hh * ((b0 + b1) / 2 - hh * (a @ (b0 / 6 + b1 / 3)))


def _solve(decay: np.ndarray, forcing: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Run the recurrence S <- decay (S + forcing) over axis 0; return S at all nodes.

    Cut into about sqrt(n) runs that advance side by side from zero, with what the run's start becomes; then
    the runs are chained.
    """
    n = decay.shape[0]
    length = max(1, math.isqrt(n))
    runs = -(-n // length)
    padding = ((0, runs * length - n), *[(0, 0)] * (decay.ndim - 1))
    steps = np.pad(decay, padding).reshape(runs, length, *decay.shape[1:])
    added = np.pad(decay @ forcing, padding).reshape(runs, length, *forcing.shape[1:])
    carried = np.empty_like(steps)
    carried[:, 0] = steps[:, 0]
    for k in range(1, length):
        np.matmul(steps[:, k], carried[:, k - 1], out=carried[:, k])
        added[:, k] += steps[:, k] @ added[:, k - 1]
    starts = np.empty((runs, *start.shape))
    starts[0] = start
    for k in range(1, runs):
        starts[k] = carried[k - 1, -1] @ starts[k - 1] + added[k - 1, -1]
    added += carried @ starts[:, None]
    return np.concatenate([start[None], added.reshape(-1, *start.shape)[:n]])


def shape_variation(
    structure: Structure, nodes: Nodes, p: np.ndarray, seeds: np.ndarray, width: float
) -> np.ndarray:
    """Return d(kappa, dkappa)/d coordinates at the nodes, shape (nodes, 2 (N-1), K)."""
    n, columns = structure.segments, seeds.shape[1]
    acting = _acting(structure, seeds)
    out = np.zeros((nodes.time_s.size, 2 * n, columns))
    if not acting.any():
        return out
    function = _actuator_slopes(structure)
    states = 2 + build(structure)[2].memories
    moving: tuple[np.ndarray, ...] = (nodes.kappa, nodes.dkappa)
    if states > 2:
        hysteresis = ["hysteresis" in name for name in build(structure)[0].names]
        moving += (with_memory(nodes, width) if seeds[hysteresis].any() else _no_memory(nodes),)
    # at a switch the rates jump: a node then counts twice, under the valves before and after it
    switched = np.append(np.any(np.diff(nodes.valve, axis=0) != 0, axis=1), True)
    ends = np.flatnonzero(switched) + 1
    row = np.concatenate([np.arange(switched.size), ends])
    valve = np.concatenate([nodes.valve, nodes.valve[ends - 1]])
    own, by_p = evaluate(function, (*(v[row] for v in moving), valve), p)
    own = own.reshape(-1, states, states - 1, n).transpose(0, 3, 2, 1)  # (rows, segment, (ddk, dz), state)
    forced = by_p.reshape(-1, seeds.shape[0], (states - 1) * n).transpose(0, 2, 1) @ seeds[:, acting]
    forced = forced.reshape(-1, states - 1, n, int(acting.sum())).transpose(0, 2, 1, 3)
    left = np.arange(switched.size)
    right = left + 1
    right[switched] = switched.size + np.arange(ends.size)
    sides = [(own[k], forced[k]) for k in (left, right)]
    h = np.diff(nodes.time_s)
    matrix = np.zeros((h.size, n, states, states))
    matrix[:, :, 0, 1] = 1.0
    matrix[:, :, 1:, :] = (sides[0][0] + sides[1][0]) / 2
    forces = []
    for _, forced in sides:
        b = np.zeros((h.size, n, states, forced.shape[-1]))
        b[:, :, 1:] = forced
        forces.append(b)
    hh = np.repeat(h[:, None], n, axis=1)
    found = _solve(_decay(matrix, hh), _forcing(matrix, hh, *forces), np.zeros_like(forces[0][0]))
    out[:, :, acting] = found[:, :, :2].transpose(0, 2, 1, 3).reshape(h.size + 1, 2 * n, -1)
    return out


def _no_memory(nodes: Nodes) -> np.ndarray:
    return nodes.memory if nodes.memory.shape[1] else np.zeros_like(nodes.kappa)


def _acting(structure: Structure, seeds: np.ndarray) -> np.ndarray:
    """Return which columns of `seeds` touch the actuators."""
    names = build(structure)[0].names
    words = ("curvature_per_pressure", "tau", "segment_bias", "asymmetry", "stiffening", "hysteresis")
    rows = [any(word in name for word in words) for name in names]
    return np.asarray(np.any(seeds[rows] != 0, axis=0))


def variation(
    structure: Structure, nodes: Nodes, p: np.ndarray, seeds: np.ndarray, heading_rad: float, width: float
) -> Variation:
    """Return the sensitivities of pose and curvature to the coordinates behind `seeds` (parameters, K).

    `p` and the rows of `seeds` are the parameters of `structure`, which may be smaller than the nodes' own.
    """
    shape = shape_variation(structure, nodes, p, seeds, width)
    _, by_body, by_shape, by_p = evaluate(_body_slopes(structure), (nodes.body, nodes.kappa, nodes.dkappa), p)
    count = nodes.time_s.size
    a = np.ascontiguousarray(by_body.reshape(count, 6, 6).transpose(0, 2, 1))
    c = by_shape.reshape(count, -1, 6).transpose(0, 2, 1)
    d = by_p.reshape(count, -1, 6).transpose(0, 2, 1)
    touched = np.any(seeds != 0, axis=1)
    b = c @ shape + d[:, :, touched] @ seeds[touched]
    h = np.diff(nodes.time_s)
    middle = (a[:-1] + a[1:]) / 2
    start = np.zeros((6, seeds.shape[1]))
    start[:3] = start_pose(structure, p, heading_rad)[1] @ seeds
    states = _solve(_decay(middle, h), _forcing(middle, h, b[:-1], b[1:]), start)
    return Variation(states[:, :3], shape[:, : structure.segments])

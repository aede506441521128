"""From a simulated steady gait to the unknowns of the program, and back to a gait."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.layout import ENVELOPE_UNIT_M, PRESSURE_UNIT_KPA, Layout
from srs_opt.gait_opt.collocation.layout import Mesh as CycleMesh
from srs_opt.gait_opt.collocation.point import BODY, PointKind, linear_shape
from srs_opt.gait_opt.settings import COLLOCATION
from srs_opt.geometry import centre_of_rotation, rotate
from srs_opt.model.registry import build, state_layout
from srs_opt.orbit.steady import Orbit
from srs_opt.robot import Robot
from srs_opt.simulate.rosenbrock import VELOCITY


def switches_of(gait: Gait, first_s: float) -> np.ndarray:
    """Return the switch times as the program has them: fractions after `first_s`, on < off < on + 1.

    Segment by segment, all on-times then all off-times.
    """
    values: list[float] = []
    for pairs in gait.intervals:
        ons = sorted(
            ((on - first_s) / gait.period_s % 1.0, (off - on) / gait.period_s % 1.0) for on, off in pairs
        )
        values += [on for on, _ in ons] + [on + length for on, length in ons]
    return np.array(values)


def gait_of(switches: np.ndarray, frequency_hz: float, pressure_kpa: float, intervals: int) -> Gait:
    """Return the gait with these switch fractions."""
    period = 1 / frequency_hz
    rows = switches.reshape(-1, 2, intervals)

    def time(fraction: float) -> float:
        t = float(fraction % 1.0 * period)
        # a rounding error before the end is the start of the next cycle
        return t if t < period * (1 - 1e-12) else 0.0

    pairs = tuple(tuple((time(on), time(off)) for on, off in row.T) for row in rows)
    return Gait(period, pressure_kpa, pairs)


def gait_from(layout: Layout, z: np.ndarray) -> Gait:
    """Return the gait that a program's unknowns describe."""
    switches = z[2 : 2 + layout.switches]
    return gait_of(switches, float(z[0]), float(PRESSURE_UNIT_KPA * z[1]), layout.kinds[0].intervals)


def states_over_cycle(
    robot: Robot, kind: PointKind, orbit: Orbit, at: np.ndarray, first_s: float
) -> tuple[np.ndarray, float]:
    """Return the program's states at fractions `at` of the cycle, (points, states), and the signed speed."""
    solution, gait = orbit.solution, orbit.gait
    period = gait.period_s
    states = np.concatenate([solution.start[:, None], solution.states], axis=1)
    time_s, spread = orbit.time_s, np.linspace(0.0, period, 2001)
    turn = float(orbit.motion.displacement[2])
    u_x, u_y = (np.interp(spread, time_s, states[VELOCITY][i]) for i in range(2))
    heading = np.interp(spread, time_s, orbit.pose[:, 2]) - turn * spread / period
    # the last sample is the first of the next cycle
    v_x, v_y = (float(np.mean(v[:-1])) for v in rotate(heading, u_x, u_y))
    sign = 1.0 if v_x >= 0 else -1.0
    # turns the frame so that the mean velocity points ahead (or straight back)
    tilt = -np.arctan2(sign * v_y, sign * v_x)
    speed = sign * float(np.hypot(v_x, v_y))
    x, y = rotate(
        tilt - turn * spread / period, *(np.interp(spread, time_s, orbit.pose[:, i]) for i in range(2))
    )
    if abs(turn) < COLLOCATION.straight_turn_rad:
        ahead, aside = x - speed * spread, y
    else:  # in the frame that turns about the centre of rotation, the centre of mass stays near one place
        centre = _centre(orbit.motion.displacement)
        cx, cy = rotate(
            tilt - turn * spread / period, np.full(spread.size, centre[0]), np.full(spread.size, centre[1])
        )
        ahead, aside = x - cx, y - cy
    # the program's frame is the one with zero means
    ahead, aside = ahead - ahead[:-1].mean(), aside - aside[:-1].mean()
    # the program's time 0 is the first switch of the first segment
    places = (at * period + first_s) % period
    columns = [np.interp(places, time_s, states[VELOCITY][i]) for i in range(3)]
    columns += [np.interp(places, spread, v) for v in (heading + tilt, ahead, aside)]
    if kind.bends:
        layout = state_layout(kind.structure)
        columns += [np.interp(places, time_s, row) for row in states[layout.kappa.start : layout.dkappa.stop]]
    if kind.states > kind.moving:
        columns += _deviations(robot, kind, orbit, states, places, at, first_s)
    return np.stack(columns, axis=1), speed


def valve_levels(gait: Gait, mesh: CycleMesh, first_s: float) -> np.ndarray:
    """Return the valves' means over the elements, (elements, N-1)."""
    spread = (np.arange(20) + 0.5) / 20
    at = mesh.edges[:-1, None] + np.diff(mesh.edges)[:, None] * spread
    states = [[gait.valve(first_s + a * gait.period_s) for a in row] for row in at]
    mean: np.ndarray = np.mean(states, axis=1)
    return mean


def _centre(displacement: np.ndarray) -> np.ndarray:
    centre = centre_of_rotation(displacement)
    assert centre is not None
    return centre


def _deviations(
    robot: Robot,
    kind: PointKind,
    orbit: Orbit,
    states: np.ndarray,
    places: np.ndarray,
    at: np.ndarray,
    first_s: float,
) -> list[np.ndarray]:
    gait, own = orbit.gait, states[state_layout(kind.structure).actuator]
    if kind.relaxed:
        return [np.interp(places, orbit.time_s, row) for row in own]
    p = parameter_numbers(robot, kind)
    closed = linear_shape(replace(kind, ordered=False), at.size)(
        switches_of(gait, first_s), gait.frequency_hz, gait.pressure_kpa, at[None], p, 0.01
    )
    actuators = np.stack([np.interp(places, orbit.time_s, row) for row in own])
    n = kind.segments
    # nonlinear actuators are stated by how far they are from the closed form
    actuators[:n] -= np.asarray(closed[0])
    actuators[n : 2 * n] -= np.asarray(closed[1])
    return list(actuators)


def parameter_numbers(robot: Robot, kind: PointKind) -> np.ndarray:
    """Return the model's numbers for `robot` (pressure and frequency are placeholders)."""
    return build(kind.structure)[0].pack(robot, 1.0, 1.0)


def unknowns_from_orbits(
    layout: Layout,
    robots: list[Robot],
    orbits: list[Orbit],
    mesh: CycleMesh,
    scales: list[np.ndarray] | None = None,
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the program's unknowns and the scales of the states for one gait's orbits, one per robot."""
    gait = orbits[0].gait
    first_s = gait.intervals[0][0][0]
    z = np.zeros(layout.size)
    z[0], z[1] = gait.frequency_hz, gait.pressure_kpa / PRESSURE_UNIT_KPA
    z[2 : 2 + layout.switches] = (
        valve_levels(gait, mesh, first_s).ravel() if layout.kinds[0].relaxed else switches_of(gait, first_s)
    )
    found: list[np.ndarray] = []
    for r, (robot, orbit) in enumerate(zip(robots, orbits)):
        kind = layout.kinds[r]
        x, speed = states_over_cycle(robot, kind, orbit, mesh.points(), first_s)
        scale = state_scales(x, kind) if scales is None else scales[r]
        found.append(scale)
        z[layout.states(r)] = (x / scale).ravel()
        right, left = orbit.envelope_m
        turn_rate = float(orbit.motion.displacement[2]) / gait.period_s
        start = layout.start(r)
        z[start : start + 5] = speed, turn_rate, orbit.work_j, left / ENVELOPE_UNIT_M, right / ENVELOPE_UNIT_M
    return z, found


def state_scales(x: np.ndarray, kind: PointKind) -> np.ndarray:
    """Return typical sizes of the states over a cycle, (states,)."""
    # scaled by their sizes, all states and defects are of order one, as IPOPT's tolerances suppose
    size = np.abs(x).max(axis=0)
    # states of one kind share a scale: velocities, yaw momentum, heading, places, then bends and actuators
    groups = [(0, 2), (2, 3), (3, 4), (4, 6)]
    edges = sorted({BODY, BODY + kind.bends // 2, kind.moving, kind.states})
    groups += list(pairwise(edges))
    # nothing is divided by a zero size; a yaw momentum is smaller than other states by itself
    least = np.full(x.shape[1], 1e-3)
    least[2] = 1e-6
    for a, b in groups:
        size[a:b] = size[a:b].max() if a < BODY else np.maximum(size[a:b], 0.05 * size[a:b].max())
    scale: np.ndarray = np.maximum(size, least)
    return scale

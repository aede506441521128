"""Simulate every change of gait on the dynamic model: one cycle of each gait after each other.

After a cycle the actuators have forgotten all but the gait they played (exp(-period/tau), 0.2 % at 2 Hz);
what is left is the forward speed. The speed levels of a gait are the states in which one cycle of it ends
when begun at different speeds; from each of them every gait is simulated for a cycle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planners.motion.cycles import CycleRun
from planners.motion.settings import MOTION_TABLE
from planners.motion.table import SAMPLES, MotionTable
from planners.motion.valves import DEFAULT_LIMITS, Joints, ValveLimits
from srs_opt.errors import NoAnswerError
from srs_opt.gait_opt.table import GaitTable, TableGait
from srs_opt.orbit.actuators import periodic_actuators
from srs_opt.orbit.body import integrator
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import Robot
from srs_opt.simulate.batched import Search, run_batched
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.rosenbrock import VELOCITY
from srs_opt.simulate.shapes import centre_lines

Progress = Callable[[Iterable[int]], Iterator[int]]


class Transitions(NamedTuple):
    """What is simulated; arrays as in `MotionTable`, and the curvatures that give the bodies.

    Attributes
    ----------
    speed_m_s, speed_after_m_s, pose : arrays
    kappa : array (n + 1, n, SAMPLES + 1, N-1)
    """

    speed_m_s: NDArray[np.float64]
    speed_after_m_s: NDArray[np.float32]
    pose: NDArray[np.float32]
    kappa: NDArray[np.float32]


_Outcome = tuple[np.ndarray, np.ndarray]


def simulate_transitions(
    robot: Robot, table: GaitTable, limits: ValveLimits = DEFAULT_LIMITS, progress: Progress = iter
) -> Transitions:
    """Return what every gait does after every gait, joining cycles and ramps of pressure included.

    Parameters
    ----------
    robot : Robot
    table : GaitTable
        Its gaits; their order is that of the motion table. The last row of what comes before is rest.
    limits : ValveLimits
        What cannot follow under them is left zero.
    progress : callable
        Wraps the iteration over the gaits that come before.
    """
    run = integrator(robot, table.model)
    n = len(table.gaits)
    levels = _speed_levels(table)
    speed = np.empty((n + 1, MOTION_TABLE.levels))
    after = np.empty((n + 1, n, MOTION_TABLE.levels))
    pose = np.empty((n + 1, n, MOTION_TABLE.levels, SAMPLES + 1, 3))
    kappa = np.empty((n + 1, n, SAMPLES + 1, robot.segments))
    rows = every_cycle(run, table, limits, lambda entry: levels, progress)
    for before, (begun, cycles) in enumerate(rows):
        speed[before] = begun
        after[before], pose[before], kappa[before] = 0.0, 0.0, 0.0
        for now, level, last, samples in cycles:
            pose[before, now, level] = samples[:, :3]
            kappa[before, now] = samples[:, run.layout.kappa]
            after[before, now, level] = last[VELOCITY][0]
    # from rest there is one speed only: equal levels, spaced so that they can be looked up
    speed[n] = np.linspace(-1e-3, 1e-3, MOTION_TABLE.levels)
    after[n], pose[n] = after[n, :, :1], pose[n, :, :1]
    return Transitions(speed, *(a.astype(np.float32) for a in (after, pose, kappa)))


_Cycles = list[tuple[int, int, np.ndarray, np.ndarray]]


def every_cycle(
    run: Integrator,
    table: GaitTable,
    limits: ValveLimits,
    levels: Callable[[TableGait], np.ndarray],
    progress: Progress = iter,
) -> Iterator[tuple[np.ndarray, _Cycles]]:
    """Simulate a cycle of every gait after every gait of a table, then after rest.

    Parameters
    ----------
    levels : callable
        Of the gait before, the forward speeds at which its own cycle begins.

    Yields
    ------
    speed_m_s : array (levels,)
        Forward speeds at the begin of the cycles: that of rest is one.
    cycles : list of (now, level, last state (nx,), samples (SAMPLES + 1, nx))
        Of the gaits that can follow.
    """
    joints = Joints(table, limits)
    n = len(table.gaits)
    plain = [CycleRun(run, joints.timeline(k, k), MOTION_TABLE.step_s) for k in range(n)]
    for before in progress(range(n + 1)):
        if before == n:
            ends = [run.rest()]
        else:
            ends = _ends(run, table.gaits[before], plain[before], levels(table.gaits[before]))
        following = [now for now in range(n) if joints.joint(before, now) is not None]
        cycles = [
            plain[now]
            if joints.is_plain(before, now)
            else CycleRun(run, joints.timeline(before, now), MOTION_TABLE.step_s)
            for now in following
        ]
        outcomes = _all([cycle(_at_origin(start)) for cycle in cycles for start in ends])
        places = [(now, level) for now in following for level in range(len(ends))]
        found = [(*place, last, samples) for place, (last, samples) in zip(places, outcomes)]
        yield np.array([state[VELOCITY][0] for state in ends]), found


def motion_table(
    robot: Robot, table: GaitTable, transitions: Transitions, limits: ValveLimits = DEFAULT_LIMITS
) -> MotionTable:
    """Return the table that planners look up."""
    return MotionTable(
        names=tuple(entry.name for entry in table.gaits),
        period_s=np.array([entry.gait.period_s for entry in table.gaits]),
        steady=np.array([entry.displacement for entry in table.gaits]),
        speed_m_s=transitions.speed_m_s,
        speed_after_m_s=transitions.speed_after_m_s,
        pose=transitions.pose,
        body=_bodies(integrator(robot, table.model), transitions.kappa),
        body_width_m=robot.body_width_m,
        joints=Joints(table, limits),
    )


def _speed_levels(table: GaitTable) -> np.ndarray:
    speeds = [entry.speed_m_s for entry in table.gaits]
    margin = MOTION_TABLE.speed_margin
    return np.linspace(margin * min(0.0, *speeds), margin * max(0.0, *speeds), MOTION_TABLE.levels)


def _ends(run: Integrator, entry: TableGait, cycle: CycleRun, speeds: np.ndarray) -> list[np.ndarray]:
    """Return the states in which one cycle of a gait ends when begun at different forward speeds."""
    if run.structure.compliant:  # one cycle does not settle the bends: begin with those of the steady gait
        start = steady_gait(run.robot, entry.gait, run.structure.model).solution.start
    else:
        start = run.rest()
        gait = entry.gait
        p = run.pack(gait.pressure_kpa, gait.frequency_hz)
        start[run.layout.actuator] = periodic_actuators(run, gait, p)
    begun = []
    for speed in speeds:
        state = start.copy()
        state[VELOCITY] = speed, 0.0, 0.0
        begun.append(cycle(state))
    ends = [last for last, _ in _all(begun)]
    return sorted(ends, key=lambda state: float(state[VELOCITY][0]))


def _at_origin(state: np.ndarray) -> np.ndarray:
    moved: np.ndarray = state.copy()
    moved[:3] = 0.0
    return moved


def _all(searches: list[Search[_Outcome]]) -> list[_Outcome]:
    """Return what came of cycles simulated side by side.

    Raises
    ------
    NoAnswerError
        If one of them cannot be gone through.
    """
    outcomes = []
    for outcome in run_batched(searches):
        if isinstance(outcome, NoAnswerError):
            raise outcome
        outcomes.append(outcome)
    return outcomes


def _bodies(run: Integrator, kappa: np.ndarray) -> np.ndarray:
    """Return centre lines (before, now, SAMPLES + 1, points, 2) in the robot's frame."""
    rows = []
    for before in kappa:  # one by one: single precision takes half the memory
        lines = centre_lines(run, before.reshape(-1, before.shape[-1])).astype(np.float32)
        rows.append(lines.reshape(*before.shape[:-1], *lines.shape[1:]))
    return np.stack(rows)

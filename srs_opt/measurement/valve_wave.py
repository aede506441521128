"""What the valves of a recorded trial were told to do, and the bends that follow from rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from srs_opt.measurement.records import Array, Schedule
from srs_opt.measurement.take_settings import RUN_IN
from srs_opt.model.actuator_law import step_response
from srs_opt.robot import Robot
from srs_opt.simulate.timeline import Timeline


@dataclass(frozen=True)
class ValveWave:
    """The valve wave (13) of a trial, or its schedule."""

    frequency_hz: float
    pressure_kpa: float
    offset: float
    phase_lag_rad: float
    schedule: Schedule | None = None

    def states(self, segment: int, time_s: Array) -> Array:
        """Return S of `segment`: +1 or -1, 0 (vented) where a schedule does not name it."""
        if self.schedule is not None:
            return self.schedule.state(segment, time_s)
        wave = np.sin(2 * np.pi * self.frequency_hz * time_s + self.phase_lag_rad * segment)
        return np.where(wave + self.offset > 0, 1.0, -1.0)

    def held(self, segments: int, end_s: float) -> tuple[Array, Array]:
        """Return when the valves change, (n + 1,) from 0 to `end_s`, and how they are held, (segments, n)."""
        # a little off round instants, where S = sign(0) of (13) would be doubtful
        fine = np.arange(RUN_IN.switch_s / 200, max(end_s, RUN_IN.switch_s), RUN_IN.switch_s)
        states = np.array([self.states(i, fine) for i in range(1, segments + 1)])
        change = np.flatnonzero((np.diff(states, axis=1) != 0).any(axis=0))
        return np.concatenate([[0.0], fine[change], [end_s]]), states[:, np.concatenate([[0], change + 1])]

    def timeline(self, segments: int, end_s: float) -> Timeline:
        """Return the same for the simulation."""
        times, states = self.held(segments, end_s)
        return Timeline.constant(np.diff(times), states, self.pressure_kpa, self.frequency_hz)


def first_curvatures(robot: Robot, wave: ValveWave, time_s: Array, slowness: float = 1.0) -> Array:
    """Return the curvatures that the valves give from rest at time 0, shape (T, N-1).

    Sums of step responses (14), one per switch, up to the end of `time_s`; `slowness` multiplies both time
    constants.
    """
    total = robot.tau1_s + robot.tau2_s
    s, q = slowness * total / 2, ((robot.tau1_s - robot.tau2_s) / total) ** 2
    times, states = wave.held(robot.segments, float(time_s[-1]))
    # from vented: the first change is a step, too; superposed, as (15) is linear
    changes = np.diff(states, axis=1, prepend=0.0)
    columns = np.zeros((len(time_s), robot.segments))
    for time, change in zip(times, changes.T):
        response = step_response(time_s - time, s, q)
        columns[:, change != 0] += response[:, None] * change[change != 0]
    return columns * robot.curvature_per_pressure_1_m_kpa * wave.pressure_kpa

"""What the valves do over time: pieces of held valves, each with its pressure and frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.gait import Gait


@dataclass(frozen=True)
class Timeline:
    """Consecutive phases in which the valves are held.

    Attributes
    ----------
    duration_s : array (n,)
    valve : array (N-1, n)
        +1 bends left, -1 right, 0 vents both chambers.
    pressure_kpa, frequency_hz : array (n,)
        The regulator's setting, and the gait's frequency (for effects that depend on it).
    """

    duration_s: np.ndarray
    valve: np.ndarray
    pressure_kpa: np.ndarray
    frequency_hz: np.ndarray

    @property
    def end_s(self) -> float:
        """Total time."""
        return float(self.duration_s.sum())

    @staticmethod
    def of_gait(gait: Gait, duration_s: float) -> Timeline:
        """Play `gait` from its time 0 for `duration_s`."""
        durations, valves = gait.phases()
        # one cycle keeps the bits of its durations, which cutting would not
        if duration_s == gait.period_s:
            return Timeline.constant(durations, valves, gait.pressure_kpa, gait.frequency_hz)
        cycles = int(np.ceil(duration_s / gait.period_s - 1e-9))
        duration, valve = np.tile(durations, cycles), np.tile(valves, cycles)
        return Timeline.constant(duration, valve, gait.pressure_kpa, gait.frequency_hz).until(duration_s)

    @staticmethod
    def constant(
        duration: np.ndarray, valve: np.ndarray, pressure_kpa: float, frequency_hz: float
    ) -> Timeline:
        """Return phases that share one pressure and frequency."""
        n = duration.size
        return Timeline(duration, valve, np.full(n, pressure_kpa), np.full(n, frequency_hz))

    @staticmethod
    def vent(segments: int, duration_s: float, pressure_kpa: float, frequency_hz: float = 1.0) -> Timeline:
        """Return both chambers of every segment vented for `duration_s`."""
        return Timeline.constant(np.array([duration_s]), np.zeros((segments, 1)), pressure_kpa, frequency_hz)

    @staticmethod
    def join(parts: Sequence[Timeline]) -> Timeline:
        """Play timelines one after the other."""
        return Timeline(
            np.concatenate([p.duration_s for p in parts]),
            np.concatenate([p.valve for p in parts], axis=1),
            np.concatenate([p.pressure_kpa for p in parts]),
            np.concatenate([p.frequency_hz for p in parts]),
        )

    def part(self, phases: slice) -> Timeline:
        """Return some of the phases."""
        return Timeline(
            self.duration_s[phases],
            self.valve[:, phases],
            self.pressure_kpa[phases],
            self.frequency_hz[phases],
        )

    def at_one_pressure(self) -> Timeline:
        """Return the timeline at its highest pressure throughout, valves in parts of it.

        Where the actuators are linear, curvature follows pressure times valve state.
        """
        most = float(self.pressure_kpa.max())
        if (self.pressure_kpa == most).all():
            return self
        pressure = np.full(self.duration_s.size, most)
        return Timeline(self.duration_s, self.valve * self.pressure_kpa / most, pressure, self.frequency_hz)

    def until(self, end_s: float) -> Timeline:
        """Return the timeline cut off at `end_s`."""
        ends = np.cumsum(self.duration_s)
        starts = ends - self.duration_s
        # no phase that only rounding makes
        keep = starts < end_s - 1e-12
        duration = np.minimum(ends, end_s)[keep] - starts[keep]
        return Timeline(duration, self.valve[:, keep], self.pressure_kpa[keep], self.frequency_hz[keep])

    def delayed(self, delay_s: float) -> Timeline:
        """Return the timeline as the valves follow it: vented until `delay_s`, same total time."""
        if delay_s <= 0 or not self.duration_s.size:
            return self
        wait = Timeline.vent(
            self.valve.shape[0], delay_s, float(self.pressure_kpa[0]), float(self.frequency_hz[0])
        )
        return Timeline.join([wait, self]).until(self.end_s)

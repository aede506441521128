"""A program for the valve controller: gaits in whole ticks, the steps of a plan, the controller's limits."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from srs_opt.errors import InputError
from srs_opt.gait import Gait
from srs_opt.gait_opt.table import GaitTable
from srs_opt.gait_opt.ticks import WORD_BITS, Schedule, segment_mask
from srs_opt.simulate.timeline import Timeline

MOST_TICKS = 0xFFFE  # a cycle's ticks are counted in 16 bits
MOST_GAITS = 0xFFFE
MOST_EVENTS = 0xFFFF


@dataclass(frozen=True)
class ControllerLimits:
    """What the controller watches by itself, whatever it is told to play.

    Attributes
    ----------
    dwell_s : float
        A segment's valves stay at least so long; an earlier switch is delayed and reported as a fault.
    settle_s : float
        Wait for the regulator before the first cycle, valves vented. Shorter than the regulator's own
        response and the first cycle is played at too low a pressure; longer only delays the start.
    vent_s : float
        Time that vented chambers need to straighten the body; no command is taken before. Five times
        tau_1 + tau_2 of the built-in robot leave less than 1 % of the bend.
    timeout_s : float
        Without a word from the pilot for so long, the controller vents.
    slew_kpa_s : float or None
        Rate of the regulator's set point; None: at once.
    """

    dwell_s: float = 0.02
    settle_s: float = 0.3
    vent_s: float = 0.7
    timeout_s: float = 0.5
    slew_kpa_s: float | None = None


DEFAULT_LIMITS = ControllerLimits()


@dataclass(frozen=True)
class ProgramGait:
    """One gait in ticks; `speed_m_s` and `turn_rate_rad_s` are those of its steady motion."""

    name: str
    schedule: Schedule
    pressure_kpa: float
    speed_m_s: float
    turn_rate_rad_s: float

    @staticmethod
    def of_gait(
        name: str, gait: Gait, speed_m_s: float, turn_rate_rad_s: float, tick_s: float
    ) -> ProgramGait:
        """Return a gait in ticks; InputError where it does not stand on whole ticks."""
        try:
            schedule = Schedule.of_gait(gait, tick_s)
        except InputError as error:
            raise InputError(f"gait '{name}': {error}") from error
        return ProgramGait(name, schedule, gait.pressure_kpa, speed_m_s, turn_rate_rad_s)


@dataclass(frozen=True)
class Program:
    """Gaits, and the steps of a plan (gait index, cycles) where there is one.

    Attributes
    ----------
    robot : str
        The robot's name, for people.
    segments : int
    tick_s : float
    gaits : tuple of ProgramGait
    steps : tuple of (int, int)
        Empty for a gait table.
    limits : ControllerLimits
    """

    robot: str
    segments: int
    tick_s: float
    gaits: tuple[ProgramGait, ...]
    steps: tuple[tuple[int, int], ...] = ()
    limits: ControllerLimits = DEFAULT_LIMITS

    def __post_init__(self) -> None:
        if not self.gaits or len(self.gaits) > MOST_GAITS:
            raise InputError(f"a controller's program holds 1 to {MOST_GAITS} gaits, found {len(self.gaits)}")
        for gait in self.gaits:
            if gait.schedule.period > MOST_TICKS:
                raise InputError(
                    f"gait '{gait.name}' takes {gait.schedule.period} ticks of {self.tick_s:g} s, the "
                    f"controller counts to {MOST_TICKS}; choose a longer tick"
                )
        events = sum(len(g.schedule.events) for g in self.gaits)
        if events > MOST_EVENTS:
            raise InputError(
                f"{events} valve events, the controller counts to {MOST_EVENTS}; leave gaits out"
            )

    @staticmethod
    def of_table(table: GaitTable, tick_s: float, limits: ControllerLimits = DEFAULT_LIMITS) -> Program:
        """Return the program of a gait table, for a pilot that chooses gaits."""
        gaits = tuple(
            ProgramGait.of_gait(g.name, g.gait, g.speed_m_s, g.turn_rate_rad_s, tick_s) for g in table.gaits
        )
        return Program(table.robot_name, table.gaits[0].gait.segments, tick_s, gaits, (), limits)

    @staticmethod
    def of_cycles(
        robot: str,
        cycles: Sequence[int],
        gaits: Sequence[tuple[str, Gait, float, float]],
        tick_s: float,
        limits: ControllerLimits = DEFAULT_LIMITS,
    ) -> Program:
        """Return the program of a plan that runs by itself.

        Parameters
        ----------
        cycles : sequence of int
            Index into `gaits` of every cycle, joining cycles included.
        gaits : sequence of (name, Gait, speed_m_s, turn_rate_rad_s)
        """
        entries = tuple(ProgramGait.of_gait(*entry, tick_s) for entry in gaits)
        steps: list[tuple[int, int]] = []
        for gait in cycles:
            if steps and steps[-1][0] == gait:
                steps[-1] = (gait, steps[-1][1] + 1)
            else:
                steps.append((gait, 1))
        return Program(robot, gaits[0][1].segments, tick_s, entries, tuple(steps), limits)

    @property
    def words(self) -> int:
        """32-bit words per valve mask."""
        return -(-2 * self.segments // WORD_BITS)

    @property
    def identity(self) -> int:
        """32 bits that tell this program from others; the pilot asks the robot for it."""
        return int.from_bytes(hashlib.sha256(json.dumps(self._content()).encode()).digest()[:4], "little")

    def _content(self) -> Mapping[str, Any]:
        gaits = [(g.schedule.period, g.schedule.events, round(g.pressure_kpa * 1e3)) for g in self.gaits]
        return {"segments": self.segments, "tick": self.tick_s, "gaits": gaits, "steps": self.steps}

    def ticks(self, time_s: float) -> int:
        """Return a time in ticks, rounded up, within 16 bits."""
        # rounded up: a dwell must not become shorter
        return min(max(0, -int(-time_s / self.tick_s // 1)), 0xFFFE)


def events_of(timeline: Timeline, tick_s: float) -> tuple[list[tuple[int, int]], int]:
    """Return a timeline's valve events (tick, mask) and its length in ticks, each switch at the nearest tick.

    The pressure is not part of it: a cycle has one.
    """
    ends = np.round(np.cumsum(timeline.duration_s) / tick_s).astype(int)
    begins = [0, *map(int, ends[:-1])]
    events: list[tuple[int, int]] = []
    for begin, end, states in zip(begins, ends, timeline.valve.T):
        mask = sum(segment_mask(i, int(state)) for i, state in enumerate(states))
        if end > begin and (not events or events[-1][1] != mask):
            events.append((begin, mask))
    return events, int(ends[-1])

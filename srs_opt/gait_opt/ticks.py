"""A gait as a controller plays it: integer ticks and valve bit masks."""

from __future__ import annotations

from dataclasses import dataclass

from srs_opt.errors import InputError
from srs_opt.gait import Gait

WORD_BITS = 32
LEFT_BIT, RIGHT_BIT = 1, 2  # of a segment's two valves


def segment_mask(segment: int, state: int) -> int:
    """Return the bits of one segment (from 0, the tail): left valve for +1, right for -1, none for 0."""
    return {1: LEFT_BIT, -1: RIGHT_BIT, 0: 0}[state] << (2 * segment)


@dataclass(frozen=True)
class Schedule:
    """One cycle in ticks.

    Attributes
    ----------
    period : int
        Ticks per cycle.
    events : tuple of (tick, mask)
        From `tick` on the valves stand as `mask` says; the first tick is 0, ticks ascend.
    """

    period: int
    events: tuple[tuple[int, int], ...]

    @staticmethod
    def of_gait(gait: Gait, tick_s: float) -> Schedule:
        """Return the schedule of a gait that stands on whole ticks.

        Raises
        ------
        InputError
            If its period or a switch does not.
        """
        period = _whole(gait.period_s, tick_s, "period")
        switches = {0} | {
            _whole(t, tick_s, "a switch") % period for pairs in gait.intervals for pair in pairs for t in pair
        }
        events: list[tuple[int, int]] = []
        for tick in sorted(switches):
            # asked half a tick later: rounding at the switch itself must not decide
            states = gait.valve((tick + 0.5) * tick_s)
            mask = sum(segment_mask(i, int(s)) for i, s in enumerate(states))
            if not events or events[-1][1] != mask:
                events.append((tick, mask))
        return Schedule(period, tuple(events))

    def mask(self, tick: int) -> int:
        """Return the valves at any tick."""
        at = tick % self.period
        return next(mask for start, mask in reversed(self.events) if start <= at)


def _whole(time_s: float, tick_s: float, what: str) -> int:
    ticks = round(time_s / tick_s)
    if abs(ticks * tick_s - time_s) > 1e-6 * max(time_s, tick_s):
        raise InputError(f"{what} of a gait, {time_s:g} s, is not a whole number of ticks of {tick_s:g} s")
    return ticks

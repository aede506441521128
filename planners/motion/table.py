"""The motion table: where a cycle leads, and where the body is meanwhile, by lookup."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planners.motion.bending import Bending
from planners.motion.settings import MOTION_TABLE
from planners.motion.valves import Joint, Joints
from srs_opt.geometry import compose, points_in_room

SAMPLES = 16  # intervals per cycle at which pose and body are kept

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]


class Motion(NamedTuple):
    """What one cycle does, for several gaits at once, from one state.

    Attributes
    ----------
    pose : array (gaits, SAMPLES + 1, 3)
        Centre of mass and mean heading over the cycle, in the room.
    speed_m_s : array (gaits,)
        Forward speed at the cycle's end.
    """

    pose: Array
    speed_m_s: Array


@dataclass(frozen=True)
class MotionTable:
    """Motion of every gait after every gait, n gaits.

    Attributes
    ----------
    names : tuple of str
    period_s : array (n,)
    steady : array (n, 3)
        Displacement per cycle in the steady state, in the frame of the cycle's start.
    speed_m_s : array (n + 1, levels)
        Forward speeds at the end of a cycle for which the table holds; the last row is rest.
    speed_after_m_s : array (n + 1, n, levels)
        Forward speed after a cycle of the second gait, begun at those speeds.
    pose : array (n + 1, n, levels, SAMPLES + 1, 3)
        Poses over that cycle, in the frame of its start.
    body : array (n + 1, n, SAMPLES + 1, points, 2)
        Centre line over that cycle in the robot's frame, tail to head.
    body_width_m : float
    joints : Joints
        How a cycle follows another; where none can, the arrays mean nothing.
    origin : tuple of int
        The gait that each cycle made for one plan has come from; it leaves the robot much as that gait does.
    deviation_m : array (n + 1,), optional
        How far the body may be off after a cycle of each gait because its stiffness is.
    """

    names: tuple[str, ...]
    period_s: Array
    steady: Array
    speed_m_s: Array
    speed_after_m_s: NDArray[np.float32]
    pose: NDArray[np.float32]
    body: NDArray[np.float32]
    body_width_m: float
    joints: Joints
    origin: tuple[int, ...] = ()
    deviation_m: Array | None = None

    @property
    def rest(self) -> int:
        """Row of the robot at rest, straight."""
        return len(self.names)

    @property
    def size(self) -> int:
        """Number of gaits."""
        return len(self.names)

    def row(self, number: int) -> int:
        """Return the row of what is played: itself for gaits and rest, of its gait for a plan's own cycle."""
        return int(self.row_of[number])

    @cached_property
    def row_of(self) -> Numbers:
        """Row of everything that is played, by its number: gaits, rest, then the cycles made for one plan."""
        return np.array([*range(self.rest + 1), *self.origin])

    def rows(self, numbers: Sequence[int]) -> tuple[int, ...]:
        """Return the gaits of cycles: of those made for one plan, what they have come from."""
        return tuple(self.row(number) for number in numbers)

    def periods(self, numbers: Sequence[int]) -> Array:
        """Return the durations of cycles."""
        return np.array([self.joints.gait(number).period_s for number in numbers])

    def may_follow(self, before: int) -> NDArray[np.bool_]:
        """Return which gaits (n,) can follow a cycle."""
        allowed = self.allowed[self.row(before)]
        if before <= self.rest:
            return np.asarray(allowed)
        followers: NDArray[np.bool_] = allowed & [
            self.joints.joint(before, now) is not None for now in range(self.size)
        ]
        return followers

    def with_own(self, own: Sequence[Joint], origin: Sequence[int]) -> MotionTable:
        """Return the table with cycles made for one plan, and the gaits that they have come from."""
        return replace(self, joints=self.joints.with_own(own), origin=tuple(origin))

    def move(self, x: float, y: float, heading: float, before: int, speed_m_s: float) -> Motion:
        """Return what a cycle of each gait does from one state, (gaits, ...)."""
        before = self.row(before)
        low, weight = self._level(before, speed_m_s)
        tables = self.pose[before], self.speed_after_m_s[before]
        local, after = ((1 - weight) * t[:, low] + weight * t[:, low + 1] for t in tables)
        return Motion(compose(np.array([x, y, heading]), local), after)

    def ends(
        self, start: Array, before: Sequence[int] | Numbers, speed_m_s: Sequence[float] | Array
    ) -> Motion:
        """Return where a cycle of each gait ends from several states.

        Parameters
        ----------
        start : array (n, 3)
        before, speed_m_s : array (n,)

        Returns
        -------
        Motion
            Pose (n, gaits, 3) and speed (n, gaits) at the ends.
        """
        rows, low, weight = self._levels(np.asarray(before), np.asarray(speed_m_s))
        local, after = (
            _between(t[rows, :, low], t[rows, :, low + 1], weight)
            for t in (self.pose[..., -1, :], self.speed_after_m_s)
        )
        return Motion(compose(start[:, None], local), after.astype(np.float64))

    def poses(
        self,
        start: Array,
        before: Sequence[int] | Numbers,
        speed_m_s: Sequence[float] | Array,
        now: Numbers,
    ) -> Array:
        """Return the poses (n, SAMPLES + 1, 3) over cycles of gaits `now` (n,), each from its own state."""
        rows, low, weight = self._levels(np.asarray(before), np.asarray(speed_m_s))
        local = _between(self.pose[rows, now, low], self.pose[rows, now, low + 1], weight)
        return compose(start[:, None], local)

    def bent(self, bending: Bending) -> MotionTable:
        """Return the table with measured factors on all its cycles."""
        swing = self.course[None, :-1] - self.course[:, None]
        share = np.linspace(0.0, 1.0, SAMPLES + 1)
        pose = np.stack([bending.local(row, s[:, None], share) for row, s in zip(self.pose, swing)])
        steady = np.array([bending.calibration.displacement(d) for d in self.steady])
        return replace(self, pose=pose.astype(np.float32), steady=steady)

    def _level(self, before: int, speed_m_s: float) -> tuple[int, float]:
        levels = self.speed_m_s[before]
        low = int(np.searchsorted(levels, speed_m_s)) - 1
        low = min(max(low, 0), levels.size - 2)
        weight = (speed_m_s - levels[low]) / (levels[low + 1] - levels[low])
        return low, float(min(max(weight, -0.5), 1.5))

    def _levels(self, before: Numbers, speed_m_s: Array) -> tuple[Numbers, Numbers, NDArray[np.float32]]:
        """Return rows, levels below the speeds and the weights of the levels above, (n,) each."""
        rows = self.row_of[before]
        levels = self.speed_m_s[rows]
        # as `_level`: the last level below each speed, and within the table
        low = ((levels < speed_m_s[:, None]).sum(axis=1) - 1).clip(0, levels.shape[1] - 2)
        each = np.arange(rows.size)
        below = levels[each, low]
        weight = (speed_m_s - below) / (levels[each, low + 1] - below)
        return rows, low, weight.clip(-0.5, 1.5).astype(np.float32)

    def bodies(self, before: int, now: NDArray[np.int64] | slice, pose: Array) -> Array:
        """Return centre lines in the room, (gaits, SAMPLES + 1, points, 2), for poses of the same gaits."""
        return points_in_room(self.body[self.row(before), now], pose)

    @cached_property
    def allowed(self) -> NDArray[np.bool_]:
        """Whether a gait can follow another (n + 1, n): a cycle that is simulated moves the body."""
        return np.asarray(self.pose[:, :, 0].any(axis=(2, 3)))

    @cached_property
    def course(self) -> Array:
        """Angle from the mean heading to the path's direction at the cycle's end, per gait and rest (n + 1,).

        The mean heading swings within a cycle; the direction of travel in the steady state is the chord of
        a cycle less half its turn. Gaits that back up point against their heading.
        """
        return np.append(courses(self.steady, MOTION_TABLE.still * self.body_width_m), 0.0)

    @cached_property
    def steady_speed_m_s(self) -> Array:
        """Mean speed of each gait in the steady state, negative backwards (n,)."""
        dx, dy, _ = self.steady.T
        forward = np.where(dx >= 0, 1.0, -1.0)
        return np.asarray(forward * np.hypot(dx, dy) / self.period_s)


def courses(steady: Array, still_m: float) -> Array:
    """Return the angles from mean heading to direction of travel at cycles' ends (n,); see `course`.

    Parameters
    ----------
    steady : array (n, 3)
        Displacement per cycle.
    still_m : float
        What moves less per cycle has no direction of travel: 0.
    """
    dx, dy, turn = steady.T
    backwards = dx < 0
    chord = np.arctan2(np.where(backwards, -dy, dy), np.where(backwards, -dx, dx))
    return np.where(np.hypot(dx, dy) > still_m, chord - turn / 2, 0.0)


def _between(
    low: NDArray[np.float32], high: NDArray[np.float32], weight: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Interpolate between two levels of several entries (n, ...)."""
    weight = weight.reshape(-1, *[1] * (low.ndim - 1))
    return np.asarray((1 - weight) * low + weight * high)

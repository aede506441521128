"""What a cycle of a gait does after a cycle of another, before its motion is steady.

A controller that adds up steady displacements while it changes gaits is off by decimetres per metre. What a
cycle does depends on the gait before (its bends at the cycle's end), the gait now, and the forward speed at
its begin: so this table holds it for every pair of gaits at three speeds, to be interpolated linearly.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from srs_opt.errors import InputError
from srs_opt.gait_opt.table_settings import TABLE

LEVELS = 3  # speeds: two forecast 2.5 m of changing gaits to 0.15 m, three to 0.03 m, four no better
STEP_M, STEP_RAD, STEP_M_S = 1e-4, 1e-3, 1e-3  # of the integers that files hold
UNITS = (STEP_M, STEP_M, STEP_RAD, STEP_M_S)
WEIGHT_STEPS = 1024  # of an interpolation weight: controllers have no fractions
WEIGHTS = (-512, 1536)  # a speed beyond the levels is extrapolated by half a step at most
MOST = 32767


class Moved(NamedTuple):
    """What one cycle does.

    Attributes
    ----------
    dx_m, dy_m, turn_rad : float
        Displacement of centre of mass and mean heading, in the frame of the pose at the cycle's start.
    speed_m_s : float
        Forward speed at the cycle's end: with it the next cycle is looked up.
    """

    dx_m: float
    dy_m: float
    turn_rad: float
    speed_m_s: float


@dataclass(frozen=True, eq=False)
class Changes:
    """What every gait of a table does after every gait, n gaits; before the first is rest, number n.

    Attributes
    ----------
    speed : int array (n + 1, LEVELS)
        Forward speeds at a cycle's begin, ascending, in `STEP_M_S`.
    course : int array (n + 1,)
        Angle from the mean heading to the direction of travel where a cycle of the gait ends, in `STEP_RAD`.
    moved : int array (n + 1, n, LEVELS, 4)
        dx, dy, turn, speed at the end, in `UNITS`; all zero where the gait cannot follow.
    """

    speed: NDArray[np.int16]
    course: NDArray[np.int16]
    moved: NDArray[np.int16]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Changes) and self._bytes() == other._bytes()

    def __hash__(self) -> int:
        return hash(self._bytes())

    def _bytes(self) -> tuple[bytes, ...]:
        return tuple(array.tobytes() for array in (self.speed, self.course, self.moved))

    @staticmethod
    def of_floats(speed_m_s: np.ndarray, course_rad: np.ndarray, moved: np.ndarray) -> Changes:
        """Return the changes as files hold them."""
        return Changes(_whole(speed_m_s / STEP_M_S), _whole(course_rad / STEP_RAD), _whole(moved / UNITS))

    @property
    def rest(self) -> int:
        """Number of the robot at rest, straight."""
        return len(self.moved) - 1

    def after(self, before: int, now: int, speed_m_s: float) -> Moved | None:
        """Return what a cycle of gait `now` does, begun at a forward speed after `before`.

        None where it cannot follow.
        """
        steps = self.steps_after(before, now, round(speed_m_s / STEP_M_S))
        return None if steps is None else Moved(*(float(k) * unit for k, unit in zip(steps, UNITS)))

    def steps_after(self, before: int, now: int, speed: int) -> tuple[int, ...] | None:
        """Return the same in whole `UNITS`, as `srs_after` of the firmware finds it."""
        levels, cells = self.speed[before].tolist(), self.moved[before, now].tolist()
        if not any(map(any, cells)):
            return None
        # whole numbers throughout, as the firmware computes: both choose the same gait to the last bit
        low = 1 if speed > levels[1] else 0
        weight = _divided((speed - levels[low]) * WEIGHT_STEPS, max(levels[low + 1] - levels[low], 1))
        weight = min(max(weight, WEIGHTS[0]), WEIGHTS[1])
        between = [WEIGHT_STEPS * a + (b - a) * weight for a, b in zip(cells[low], cells[low + 1])]
        half = WEIGHT_STEPS // 2
        return tuple(_divided(v + (half if v >= 0 else -half), WEIGHT_STEPS) for v in between)

    def nearest(
        self,
        near: Iterable[tuple[int, float, float]],
        before: int,
        begun_m_s: float,
        wanted: tuple[float, float],
    ) -> int | None:
        """Return which gait moves nearest to what is wanted, next and later on, None if none can follow.

        Parameters
        ----------
        near : iterable of (number, period_s, off_m_s)
            How far its steady motion is off.
        begun_m_s : float
            Forward speed now.
        wanted : (speed m/s, turn rate rad/s)
            A turn rate of 1 rad/s weighs as 0.1 m/s.
        """
        best, least = None, math.inf
        speed, turn = round(wanted[0] / STEP_M), round(wanted[1] / STEP_RAD)
        for number, period_s, off_m_s in near:
            steps = self.steps_after(before, number, round(begun_m_s / STEP_M_S))
            if steps is None:
                continue
            # the mean heading swings within a cycle, and each gait at its own phase: the path's turn counts
            swung = steps[2] + int(self.course[number]) - int(self.course[before])
            way = math.isqrt(steps[0] ** 2 + steps[1] ** 2) * (1 if steps[0] >= 0 else -1)
            per_s = round(period_s * 1e6)
            off = _divided(way * 1000000, per_s) - speed, _divided(swung * 1000000, per_s) - turn
            miss = off[0] ** 2 + off[1] ** 2 + TABLE.steady_weight * round((off_m_s / STEP_M) ** 2)
            if miss < least:
                best, least = number, miss
        return best

    def of_first(self, count: int) -> Changes:
        """Return the changes among the first gaits and rest."""
        rows = [*range(count), self.rest]
        return Changes(self.speed[rows], self.course[rows], self.moved[rows][:, :count])

    def record(self) -> dict[str, Any]:
        """Return the JSON object: a row of `moved` per gait before, 16-bit little-endian in base64."""
        rows = [base64.b64encode(row.astype("<i2").tobytes()).decode() for row in self.moved]
        return {"speed_mm_s": self.speed.tolist(), "course_mrad": self.course.tolist(), "moved": rows}

    @staticmethod
    def of_record(record: dict[str, Any], gaits: int) -> Changes:
        """Return the changes of a table of so many gaits; InputError if they are not whole."""
        rows = [base64.b64decode(row) for row in record["moved"]]
        lists = (rows, record["speed_mm_s"], record["course_mrad"])
        if any(len(each) != gaits + 1 for each in lists):
            raise InputError(f"expected {gaits + 1} rows each, of {gaits} gaits and of rest")
        if any(len(row) != gaits * LEVELS * 8 for row in rows):
            raise InputError(f"expected {gaits * LEVELS * 8} bytes in every row of 'moved'")
        moved = np.frombuffer(b"".join(rows), "<i2").reshape(gaits + 1, gaits, LEVELS, 4)
        speed = np.array(record["speed_mm_s"], dtype=np.int16)
        return Changes(speed, np.array(record["course_mrad"], dtype=np.int16), moved.astype(np.int16))


def _divided(number: int, by: int) -> int:
    """Divide towards zero, as C does; `by` is above 0."""
    return number // by if number >= 0 else -(-number // by)


def _whole(values: np.ndarray) -> NDArray[np.int16]:
    return np.round(values).clip(-MOST, MOST).astype(np.int16)

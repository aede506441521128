"""Trials that begin in mid-gait: where the robot was and the clock's offset are fitted to the track.

The robot runs in, so that the start no longer matters; pose and offset are eliminated from the normal
equations (variable projection), so that the fit's own coordinates do not know of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from srs_opt.calibrate.data_settings import ALIGNMENT
from srs_opt.geometry import quarter_turn, rotation_matrix, turn_onto

FREE = 4  # unknowns per trial


@dataclass(frozen=True)
class Alignment:
    """How a predicted motion lies on the track.

    Attributes
    ----------
    later_s : float
        The sample labelled t shows the motion at t + later_s.
    turn_rad : float
        About the origin, before the shift.
    shift_m : array (2,)
    """

    later_s: float
    turn_rad: float
    shift_m: np.ndarray

    @property
    def matrix(self) -> np.ndarray:
        """Return the rotation (2, 2)."""
        return rotation_matrix(self.turn_rad)

    def points(self, points: np.ndarray) -> np.ndarray:
        """Return x1, y1, x2, ... (T, 2 M) where they lie."""
        pairs = points.reshape(len(points), -1, 2)
        return np.asarray(pairs @ self.matrix.T + self.shift_m).reshape(points.shape)

    def jacobian(self, jacobian: np.ndarray) -> np.ndarray:
        """Return derivatives of points, (T, 2 M, K), turned with them."""
        frames, values, count = jacobian.shape
        pairs = jacobian.reshape(frames, values // 2, 2, count)
        turned: np.ndarray = np.einsum("ij,tmjk->tmik", self.matrix, pairs).reshape(jacobian.shape)
        return turned

    def pose(self, pose: np.ndarray) -> np.ndarray:
        """Return poses (T, 3), moved alike."""
        return np.column_stack([pose[:, :2] @ self.matrix.T + self.shift_m, pose[:, 2] + self.turn_rad])


def align(
    track: np.ndarray, predicted: Callable[[float], np.ndarray], most_s: float
) -> tuple[Alignment, np.ndarray]:
    """Return the best alignment, and the derivatives of the aligned points by its unknowns, (T, 2 M, 4).

    Parameters
    ----------
    track : array (T, 2 M)
        NaN where lost.
    predicted : callable
        Shift of the clock -> points (T, 2 M).
    most_s : float
        Limit of that shift, to either side.
    """
    seen = np.isfinite(track)
    later = 0.0
    for _ in range(ALIGNMENT.rounds):
        points = predicted(later)
        found = _rigid(track, points, later)
        ends = [predicted(later + side * ALIGNMENT.difference_s) for side in (1, -1)]
        velocity = found.points(ends[0]) - found.points(ends[1])
        placed = found.points(points)
        by = np.stack([*_moves(placed), velocity / (2 * ALIGNMENT.difference_s)], axis=2)
        # Gauss-Newton in the clock; the rigid part is solved exactly in every round
        step = np.linalg.lstsq(by[seen], (track - placed)[seen], rcond=None)[0][-1]
        moved = float(np.clip(later + step, -most_s, most_s))
        if abs(moved - later) < ALIGNMENT.settled_s:
            break
        later = moved
    return found, by


def _moves(points: np.ndarray) -> list[np.ndarray]:
    """Return the changes of points (T, 2 M) by shifts along x and y and a turn about the origin."""
    pairs = points.reshape(len(points), -1, 2)
    along = [np.broadcast_to(np.eye(2)[k], pairs.shape) for k in range(2)]
    turned = quarter_turn(pairs)
    return [move.reshape(points.shape) for move in (*along, turned)]


def _rigid(track: np.ndarray, points: np.ndarray, later_s: float) -> Alignment:
    """Return the turn and shift of least squares (Procrustes)."""
    z, p = (np.ascontiguousarray(v).reshape(len(v), -1, 2) @ np.array([1, 1j]) for v in (track, points))
    seen = np.isfinite(z)
    z, p = z[seen], p[seen]
    turn = float(turn_onto(p - p.mean(), z - z.mean()))
    shift = z.mean() - np.exp(1j * turn) * p.mean()
    return Alignment(later_s, turn, np.array([shift.real, shift.imag]))

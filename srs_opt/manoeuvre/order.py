"""The order of valve switches as linear constraints on their changes: dwell, cycle's ends, what follows."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from srs_opt.gait import Gait


class OrderRows:
    """Rows of ``A x <= b`` for changes x of times: what comes later keeps its distance."""

    def __init__(self) -> None:
        self._entries: list[tuple[int, int, float]] = []
        self._room: list[float] = []

    def add(self, later: int | None, earlier: int | None, gap: float) -> None:
        """Add a row: `gap` is what columns `later` and `earlier` (None: fixed) have to spare."""
        if later is not None:
            self._entries.append((len(self._room), later, -1.0))
        if earlier is not None:
            self._entries.append((len(self._room), earlier, 1.0))
        self._room.append(gap)

    def matrix(self, size: int) -> tuple[sparse.csr_matrix, np.ndarray]:
        """Return A (rows, size) and b (rows,)."""
        if not self._room:
            return sparse.csr_matrix((0, size)), np.zeros(0)
        at_row, at_column, value = zip(*self._entries)
        matrix = sparse.csr_matrix((value, (at_row, at_column)), shape=(len(self._room), size))
        return matrix, np.array(self._room)


def standing_s(following: Gait, dwell_s: float) -> tuple[float, ...]:
    """Return how long each segment's last state must have stood when the cycle of `following` begins."""
    first = [min(t for pair in pairs for t in pair) for pairs in following.intervals]
    return tuple(max(dwell_s - t, 0.0) for t in first)

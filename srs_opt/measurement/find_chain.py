"""Find the robot among unordered positions: a row of N positions one pitch apart."""

from __future__ import annotations

import numpy as np

from srs_opt.measurement.chain import Chain
from srs_opt.measurement.records import Array

TOLERANCE = 0.25  # of a pitch
MOST_PATHS = 200_000


def find_chain(chain: Chain, positions: Array) -> np.ndarray | None:
    """Return the indices of the N positions that best make a chain, in order along it; None if none do.

    Which end is the tail is not known here.

    Parameters
    ----------
    chain : Chain
    positions : ndarray, shape (P, 2)
        NaN where there is none; ghosts allowed.
    """
    distance = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    misfit = np.abs(distance / chain.pitch_m - 1)
    neighbours = [np.flatnonzero(row < TOLERANCE) for row in np.nan_to_num(misfit, nan=np.inf)]
    best: tuple[float, tuple[int, ...]] = (np.inf, ())
    budget = MOST_PATHS
    stack: list[tuple[tuple[int, ...], float]] = [
        ((i,), 0.0) for i in range(len(positions)) if len(neighbours[i])
    ]
    while stack and budget:
        budget -= 1
        path, cost = stack.pop()
        if cost >= best[0]:
            continue
        if len(path) == chain.links:
            best = (cost, path)
            continue
        for j in neighbours[path[-1]]:
            if j not in path:
                turn = _turn(positions, path, int(j))
                if turn < 1.6:  # a segment does not bend by more than about a right angle
                    stack.append(((*path, int(j)), cost + misfit[path[-1], j] + 0.05 * turn))
    return np.array(best[1]) if best[1] else None


def _turn(positions: Array, path: tuple[int, ...], new: int) -> float:
    if len(path) < 2:
        return 0.0
    a = positions[path[-1]] - positions[path[-2]]
    b = positions[new] - positions[path[-1]]
    return float(abs(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)))


def best_start(chain: Chain, cloud: Array, tries: int = 200) -> tuple[int, np.ndarray] | None:
    """Return the first frame that shows a whole chain, and the order of its positions."""
    counts = np.isfinite(cloud[..., 0]).sum(axis=1)
    for frame in np.flatnonzero(counts >= chain.links)[:tries]:
        order = find_chain(chain, cloud[frame])
        if order is not None:
            return int(frame), order
    return None

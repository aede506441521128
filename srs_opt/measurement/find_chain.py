"""Find the robot among unordered positions: a row of M positions as far apart as its markers sit."""

from __future__ import annotations

import numpy as np

from srs_opt.geometry import turning_angles, wrapped
from srs_opt.measurement.chain import Chain
from srs_opt.measurement.records import Array
from srs_opt.measurement.take_settings import LABELS


def find_chain(chain: Chain, positions: Array) -> np.ndarray | None:
    """Return the indices of the M positions that best make a chain, in the markers' order; None if none do.

    Which end is the tail is not known here where the spacing is `symmetric`.

    Parameters
    ----------
    chain : Chain
    positions : ndarray, shape (P, 2)
        NaN where there is none; ghosts allowed.
    """
    distance = np.linalg.norm(positions[:, None] - positions[None], axis=2)
    misfit = np.abs(np.nan_to_num(distance, nan=np.inf) / chain.spacing_m[:, None, None] - 1)
    neighbours = [[np.flatnonzero(row < LABELS.chain_tolerance) for row in each] for each in misfit]
    corners = turning_angles(chain.straight_m)
    best: tuple[float, tuple[int, ...]] = (np.inf, ())
    budget = LABELS.most_paths
    stack: list[tuple[tuple[int, ...], float]] = [
        ((i,), 0.0) for i in range(len(positions)) if len(neighbours[0][i])
    ]
    while stack and budget:
        budget -= 1
        path, cost = stack.pop()
        # costs only grow along a path: this one cannot win any more
        if cost >= best[0]:
            continue
        if len(path) == chain.markers:
            best = (cost, path)
            continue
        last = len(path) - 1
        for j in neighbours[last][path[-1]]:
            if j not in path:
                # of rows that are spaced alike the straighter one wins
                turn = _turn(positions, path, int(j), corners)
                if turn < LABELS.most_turn_rad:
                    more = misfit[last, path[-1], j] + LABELS.turn_cost_1_rad * turn
                    stack.append(((*path, int(j)), cost + more))
    return np.array(best[1]) if best[1] else None


def symmetric(chain: Chain) -> bool:
    """Whether the markers' spacing looks alike from both ends."""
    gap = np.abs(chain.spacing_m - chain.spacing_m[::-1])
    return bool(gap.max() < LABELS.uneven_share * chain.spacing_m.mean())


def _turn(positions: Array, path: tuple[int, ...], new: int, corners: Array) -> float:
    """Return by how much the path bends at its end, beyond what the straight robot's markers do there."""
    if len(path) < 2:
        return 0.0
    here = float(turning_angles(positions[[path[-2], path[-1], new]])[0]) - float(corners[len(path) - 2])
    return abs(float(wrapped(here)))


def best_start(chain: Chain, cloud: Array, tries: int = 200) -> tuple[int, np.ndarray] | None:
    """Return the first frame that shows a whole chain, and the order of its positions."""
    counts = np.isfinite(cloud[..., 0]).sum(axis=1)
    for frame in np.flatnonzero(counts >= chain.markers)[:tries]:
        order = find_chain(chain, cloud[frame])
        if order is not None:
            return int(frame), order
    return None

"""Phases between switches in a fixed order: the mesh moves with the switch times, nothing is smoothed."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from srs_opt.gait_opt.collocation.goal_rows import Times
from srs_opt.gait_opt.collocation.layout import NODES, Mesh
from srs_opt.gait_opt.settings import COLLOCATION

Cuts = tuple[np.ndarray, ...]


def switch_order(switches: np.ndarray) -> np.ndarray:
    """Return the switches' indices in the order in which they happen in a cycle, the first at time 0."""
    # switches that meet but for rounding keep their order: none wraps to the end of the cycle
    fraction = np.mod(switches - switches[0] + COLLOCATION.coincident_cycles, 1.0)
    return np.argsort(fraction, kind="stable")


def phase_cuts(switches: np.ndarray, order: np.ndarray, places: np.ndarray, until: np.ndarray) -> Cuts:
    """Return where elements end inside every phase, fractions of the phase from 0 to 1.

    Parameters
    ----------
    places, until : arrays
        Fractions of the cycle after the first switch, and how many elements should end before each of them;
        both ascend. Every phase gets one element at least.
    """
    fraction = np.mod(switches - switches[0] + COLLOCATION.coincident_cycles, 1.0)[order]
    starts = np.append(fraction, 1.0 + fraction[0]) - fraction[0]
    levels = np.interp(starts, places, until)
    cuts = []
    for k in range(order.size):
        length = starts[k + 1] - starts[k]
        count = max(round(levels[k + 1] - levels[k]), 1)
        even = np.linspace(levels[k], levels[k + 1], count + 1)
        ends = (np.interp(even, until, places) - starts[k]) / length if length > 0 else even[:2] * 0
        ends[0], ends[-1] = 0.0, 1.0
        cuts.append(ends)
    return tuple(cuts)


def phase_times(switches: np.ndarray, order: np.ndarray, cuts: Cuts) -> tuple[Mesh, Times]:
    """Return the mesh at these switch times and how it moves with them.

    Parameters
    ----------
    switches : array
        Switch times as the program has them (fractions of the period, whole cycles allowed).
    order : int array
        From `switch_order`.
    cuts : from `phase_cuts`
    """
    n = switches.size
    whole = np.floor(switches - switches[0] + COLLOCATION.coincident_cycles)
    start = switches - whole
    starts = np.append(start[order], 1.0 + start[order[0]])
    phase_lengths = np.diff(starts)
    lengths, offsets = np.zeros((n, n)), np.zeros(n)
    rows, columns, constant, turns, edges = [], [], [], [], []
    data: list[float] = []
    point = 0
    for k in range(n):
        a, b = order[k], order[(k + 1) % n]
        shift_a, shift_b = -whole[a], -whole[b] + (1.0 if k == n - 1 else 0.0)
        lengths[k, b] += 1.0
        lengths[k, a] -= 1.0
        offsets[k] = shift_b - shift_a
        begun = set(order[: k + 1].tolist())
        # a switch still to come in this cycle was last made in the cycle before
        last = [whole[j] * -1.0 - (0.0 if j in begun else 1.0) for j in range(n)]
        for begin, width in zip(cuts[k], np.diff(cuts[k])):
            edges.append(starts[k] + phase_lengths[k] * begin)
            for c in NODES:
                share = begin + c * width
                # place and width are linear in the two switches that bound the phase
                for row, weights in ((2 * point, (1 - share, share)), (2 * point + 1, (-width, width))):
                    rows += [row, row]
                    columns += [a, b]
                    data += weights
                    constant.append(weights[0] * shift_a + weights[1] * shift_b)
                turns.append(last)
                point += 1
    edges.append(starts[-1])
    matrix = sparse.csr_matrix(sparse.coo_matrix((data, (rows, columns)), shape=(2 * point, n)))
    times = Times(matrix, np.array(constant), np.array(turns), lengths, offsets)
    return Mesh(np.array(edges) - starts[0]), times


def exchanged(switches: np.ndarray, order: np.ndarray) -> np.ndarray | None:
    """Return the order with every phase of zero length turned round (None if there is none)."""
    fraction = np.mod(switches - switches[0] + COLLOCATION.coincident_cycles, 1.0)
    new = order.copy()
    changed = False
    k = 1
    while k < order.size - 1:
        if (
            abs(fraction[order[k + 1]] - fraction[order[k]])
            < COLLOCATION.met_over_coincident * COLLOCATION.coincident_cycles
        ):
            new[k], new[k + 1] = order[k + 1], order[k]
            changed = True
            k += 2
        else:
            k += 1
    return new if changed else None

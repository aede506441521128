"""From exact times to the controller's ticks: one after the other, to the side that the limits prefer."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from planners.refine.limits import Values
from planners.refine.settings import WINDOW
from planners.refine.window import Window

Array = NDArray[np.float64]


def on_ticks(window: Window, rows: Values, cycles: int, tick_s: float) -> Window:
    """Return the window with the first cycles on whole ticks.

    Parameters
    ----------
    rows : Values
        Limits of the room and their derivatives at this window.
    cycles : int
        How many are rounded.
    """
    x = window.unknowns()
    n = window.switches
    owners = np.array([k for row in window.cycle_of for k in row], dtype=int)
    chosen = np.concatenate([np.flatnonzero(owners < cycles), n + np.arange(cycles)])
    order = chosen[np.argsort(x[chosen], kind="stable")]
    values = rows.values.copy()
    for column in order:
        exact = x[column] / tick_s
        sides = {round(exact)} if abs(exact - round(exact)) < 1e-6 else {math.floor(exact), math.ceil(exact)}
        tried = [
            (side * tick_s, values + rows.jacobian[:, column] * (side * tick_s - x[column])) for side in sides
        ]
        near = x[column]
        x[column], values = min(
            tried,
            key=lambda way: (
                abs(way[0] - near) - WINDOW.ticks_per_m * tick_s * float(np.minimum(way[1], 0.0).sum())
            ),
        )
    begins = np.array([0.0, *x[n : n + window.cycles]])[owners]
    x[:n] = np.maximum(x[:n], begins)  # a cycle's first switch and its begin may go to different sides
    return window.moved(x)

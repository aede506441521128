"""Cycles integrated on a fixed mesh and sampled at even instants: what searches and the motion table play."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planners.motion.table import SAMPLES
from srs_opt.simulate.batched import Search
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.timeline import Timeline

Array = NDArray[np.float64]
_BEGIN, _SHARES = np.zeros(1), np.arange(SAMPLES + 1) / SAMPLES


class CycleRun:
    """One cycle, ready to be integrated from any state.

    Parameters
    ----------
    run : Integrator
    timeline : Timeline
        Of the cycle.
    step_s : float
        Longest step.
    """

    def __init__(self, run: Integrator, timeline: Timeline, step_s: float) -> None:
        self._run = run
        self._pieces = [
            (
                Mesh.uniform(piece.duration_s, step_s),
                piece.valve,
                run.pack(float(piece.pressure_kpa[0]), float(piece.frequency_hz[0])),
            )
            for piece in run.pieces(timeline)
        ]
        steps = np.concatenate([mesh.h_s for mesh, _, _ in self._pieces])
        time = np.concatenate([_BEGIN, np.cumsum(steps)])
        at = time[-1] * _SHARES
        # sample k lies between nodes low[k] and the next, at share[k] of the way
        self._low = np.minimum(np.searchsorted(time, at, side="right") - 1, time.size - 2)
        self._share = ((at - time[self._low]) / steps[self._low])[:, None]

    def __call__(self, state: Array) -> Search[tuple[Array, Array]]:
        """Find, as a search, the last state (nx,) and samples (SAMPLES + 1, nx) from a state on."""
        parts = [state[:, None]]
        for mesh, valve, p in self._pieces:
            states, _ = yield from self._run.stepping(parts[-1][:, -1], mesh, valve, p)
            parts.append(states)
        nodes = np.concatenate(parts, axis=1).T
        samples = (1 - self._share) * nodes[self._low] + self._share * nodes[self._low + 1]
        return nodes[-1], np.asarray(samples)

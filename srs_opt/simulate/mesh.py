"""Step sizes: a mesh inside phases of held valves, refined where the error estimate is large."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.simulate.settings import STEP

ORDER = 4.0  # of the embedded error estimate's local error, h^4


@dataclass(frozen=True)
class Mesh:
    """Integration steps of consecutive phases.

    Attributes
    ----------
    h_s : array (n,)
        Step sizes.
    phase : int array (n,)
        The phase that each step belongs to, ascending.
    """

    h_s: np.ndarray
    phase: np.ndarray

    @staticmethod
    def uniform(durations: np.ndarray, step_s: float, least: int = 4) -> Mesh:
        """Divide every phase into equal steps of at most `step_s`."""
        # 1e-9: a duration that is a multiple of the step but for rounding takes no further step
        counts = np.maximum(np.ceil(durations / step_s - 1e-9).astype(int), least)
        return Mesh(np.repeat(durations / counts, counts), np.repeat(np.arange(durations.size), counts))

    def halved(self) -> Mesh:
        """Return the mesh with every step cut in two."""
        return Mesh(np.repeat(self.h_s / 2, 2), np.repeat(self.phase, 2))

    def repeated(self, times: int, phases: int) -> Mesh:
        """Return the mesh of `times` alike stretches of `phases` phases each."""
        phase = self.phase[None, :] + phases * np.arange(times)[:, None]
        return Mesh(np.tile(self.h_s, times), phase.ravel())

    def wanted(self, error: np.ndarray, tolerance: float) -> float:
        """Return how many steps `refined` would make, about."""
        return float(_density(error, tolerance).sum())

    def refined(self, error: np.ndarray, tolerance: float) -> Mesh:
        """Return a mesh whose steps should all make the same error `tolerance`.

        `error` (n,) is the estimate per step of this mesh; steps change by at most a factor 4.

        Raises
        ------
        NoAnswerError
            If that takes more steps than any motion of a real robot does.
        """
        return _divided(self.h_s, self.phase, _density(error, tolerance), 2)

    @staticmethod
    def graded(durations: np.ndarray, h_s: np.ndarray, error: np.ndarray, tolerance: float) -> Mesh:
        """Divide phases of `durations` by the errors that other steps `h_s` over the same time have made.

        The phases may be others than those of the steps: what is known is where steps have to be short.
        """
        density = _density(error, tolerance)
        times, edges = np.cumsum([0.0, *h_s]), np.cumsum([0.0, *durations])
        # cut at the nodes of both, each part with its share of its old step's new ones
        nodes = np.unique([*np.minimum(times, edges[-1]), *edges])
        middles = (nodes[:-1] + nodes[1:]) / 2
        step = np.searchsorted(times, middles).clip(1, h_s.size) - 1
        phase = np.searchsorted(edges, middles).clip(1, durations.size) - 1
        parts = np.diff(nodes)
        return _divided(parts, phase, density[step] * parts / h_s[step], 1)


def _divided(h_s: np.ndarray, phase: np.ndarray, density: np.ndarray, least: int) -> Mesh:
    """Return a mesh with `density` (n,) new steps in place of each old one, at least so many per phase."""
    phases, first = np.unique(phase, return_index=True)
    totals = np.add.reduceat(density, first)
    # rounded up and all densities of a phase raised with it: steps only get shorter
    counts = np.maximum(np.ceil(totals).astype(int), least)
    span_s = float(h_s.sum())
    if counts.sum() > max(STEP.most_per_s * span_s, STEP.most):
        raise NoAnswerError(
            f"the motion cannot be integrated: {span_s:.3g} s of it would take {counts.sum()} steps; "
            "parameters are far from those of any robot"
        )
    # the running count of new steps, made whole at every phase's end
    level = np.concatenate(
        [[0.0], np.cumsum(density * np.repeat(counts / totals, np.diff([*first, density.size])))]
    )
    times = np.concatenate([[0.0], np.cumsum(h_s)])
    nodes = np.interp(np.arange(counts.sum() + 1), level, times)
    edges = np.concatenate([[0], np.cumsum(counts)])
    # set and not interpolated: a step that ends a rounding error after a switch would straddle it
    nodes[edges] = times[[*first, density.size]]
    return Mesh(np.diff(nodes), np.repeat(phases, counts))


def _density(error: np.ndarray, tolerance: float) -> np.ndarray:
    """Return by how many new steps each old one is to be replaced."""
    # a step errs as h^4: (error/tolerance)^(1/4) shorter ones in its place err by the tolerance each
    wanted = (np.maximum(error, 1e-30) / tolerance) ** (1 / ORDER)
    return _smoothed(np.clip(wanted, 1 / STEP.largest_change, STEP.largest_change))


def _smoothed(density: np.ndarray) -> np.ndarray:
    """Widen peaks by one step to either side: features move a little when steps change."""
    wide: np.ndarray = density.copy()
    wide[1:] = np.maximum(wide[1:], STEP.beside * density[:-1])
    wide[:-1] = np.maximum(wide[:-1], STEP.beside * density[1:])
    return wide

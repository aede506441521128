"""Shapes of the whole body from curvatures: centre lines in the robot's frame, many at a time."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from srs_opt.model.outline import centre_line_function
from srs_opt.model.parameters import Structure
from srs_opt.simulate.compiled import compiled
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.zero_copy import ZeroCopy

BATCH = 48  # shapes per call of compiled code


def centre_lines(run: Integrator, kappa: np.ndarray) -> np.ndarray:
    """Return the body's centre lines for curvatures `kappa` (n, N-1).

    Returns
    -------
    lines : array (n, points, 2)
        Tail to head, m, in the frame of the centre of mass and the mean heading; see
        `srs_opt.model.outline`.
    """
    function = _batch(run.structure)
    curvature, parameters = function.arguments
    parameters[0] = run.pack(0.0, 1.0)  # geometry depends on neither pressure nor frequency
    x, y = function.results
    lines = np.empty((len(kappa), x.shape[1], 2))
    for first in range(0, len(kappa), BATCH):
        part = lines[first : first + BATCH]
        curvature[: len(part)] = kappa[first : first + BATCH]
        function.evaluate()
        part[..., 0], part[..., 1] = x[: len(part)], y[: len(part)]
    return lines


@lru_cache(maxsize=16)
def _batch(structure: Structure) -> ZeroCopy:
    key = f"centre lines {BATCH} {structure}"
    return ZeroCopy(compiled(key, lambda: centre_line_function(structure, BATCH)))

"""Derivatives of a trial's motion exactly as the integration sees them: tangents of its own steps.

For the few coordinates of a calibration this is faster than the variational equations of `sensitivity`, and
exact: those are of order 2 on the nodes, which made what tells the two time constants apart 5 % too certain.
For the many coordinates of a screening, and with effects, `sensitivity` is the cheaper one by far.
"""

from __future__ import annotations

import numpy as np

from srs_opt.calibrate.nominal import Nodes
from srs_opt.calibrate.sensitivity import Variation
from srs_opt.calibrate.start import start_pose
from srs_opt.model.parameters import Structure
from srs_opt.orbit.sensitivity import tangent_kernel
from srs_opt.simulate.kernel import LANES, Course
from srs_opt.simulate.rosenbrock import BODY_STATES


def exact_variation(
    structure: Structure, nodes: Nodes, p: np.ndarray, seeds: np.ndarray, heading_rad: float
) -> Variation:
    """Return the sensitivities of pose and curvature to the coordinates behind `seeds` (parameters, K)."""
    n, count = structure.segments, seeds.shape[1]
    nx = BODY_STATES + 2 * n
    start = np.concatenate([nodes.body[0], [0.0], nodes.kappa[0], nodes.dkappa[0]])
    turned = np.zeros((nx, count))
    turned[:3] = start_pose(structure, p, heading_rad)[1] @ seeds
    h = np.diff(nodes.time_s)
    inputs = np.column_stack([nodes.valve, np.zeros(h.size)])
    kernel = tangent_kernel(structure)
    tangents = np.empty((h.size + 1, nx, count))
    tangents[0] = turned
    for k in range(0, count, LANES):
        group = range(k, min(k + LANES, count))
        courses = [
            Course(np.concatenate([start, turned[:, j]]), h, inputs, np.concatenate([p, seeds[:, j]]))
            for j in group
        ]
        tangents[1:, :, k : k + LANES] = kernel.run(courses)[0][:, nx:]
    return Variation(tangents[:, :3], tangents[:, BODY_STATES : BODY_STATES + n])

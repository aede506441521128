"""Derivatives of a trial's motion by any coordinates: its own steps once more, one coordinate a hair off.

On a mesh that is kept the integration is a smooth function of the parameters, so that differences are exact
as the integration sees them; and the compiled steps take several coordinates at once, for a fifth of what
tangents cost. Delays need none of this: they shift the motion in time, so their derivative is minus the
velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.calibrate.nominal import Nodes
from srs_opt.calibrate.start import start_pose
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.simulate.integrate import step_kernel
from srs_opt.simulate.kernel import LANES, Course, Kernel
from srs_opt.simulate.rosenbrock import BODY_STATES

# of a coordinate's typical size: rounding then costs 1e-8 of a slope, and the bend of a motion through the
# steepest friction 1e-4
HAIR = 1e-7


@dataclass(frozen=True)
class Variation:
    """Sensitivities of one trial at its nodes.

    Attributes
    ----------
    pose : array (nodes, 3, K)
    kappa : array (nodes, N-1, K)
    """

    pose: np.ndarray
    kappa: np.ndarray


def variation(
    structure: Structure,
    nodes: Nodes,
    p: np.ndarray,
    seeds: np.ndarray,
    typical: np.ndarray,
    heading_rad: float,
) -> Variation:
    """Return the sensitivities of pose and curvature to the coordinates behind `seeds` (parameters, K).

    `p` and the rows of `seeds` are the parameters of `structure`, which may be smaller or larger than that
    with which the nodes were simulated, as long as the effects that tell them apart are absent; `typical`
    (K,) are the coordinates' typical sizes.
    """
    n, hair = structure.segments, HAIR * typical
    start = np.zeros(BODY_STATES + build(structure)[2].states)
    known = np.concatenate([nodes.body[0], [0.0], nodes.kappa[0], nodes.dkappa[0], nodes.memory[0]])
    start[: known.size] = known
    h = np.diff(nodes.time_s)

    def course(x: np.ndarray, q: np.ndarray) -> Course:
        return Course(x, h, nodes.valve, q)

    courses = []
    for off, seed, turn in zip(hair, seeds.T, (start_pose(structure, p, heading_rad)[1] @ seeds).T):
        x = start.copy()
        x[:3] += off * turn
        courses.append(course(x, p + off * seed))
    # another structure integrates the actuators otherwise: what it makes of the nodes' motion comes first
    if known.size != start.size:
        courses.insert(0, course(start, p))
    moved = _motions(step_kernel(structure), courses, n)
    if known.size == start.size:
        unmoved = np.concatenate([nodes.body[:, :3], nodes.kappa], axis=1)[..., None]
    else:
        unmoved, moved = moved[..., :1], moved[..., 1:]
    slopes = (moved - unmoved) / hair
    return Variation(slopes[:, :3], slopes[:, 3:])


def _motions(kernel: Kernel, courses: Sequence[Course], segments: int) -> np.ndarray:
    """Return pose and curvature of every course at all nodes, (nodes, 3 + segments, courses)."""
    seen = [*range(3), *range(BODY_STATES, BODY_STATES + segments)]
    found = np.empty((courses[0].h_s.size + 1, len(seen), len(courses)))
    found[0] = np.stack([c.x[seen] for c in courses], axis=1)
    for k in range(0, len(courses), LANES):
        found[1:, :, k : k + LANES] = kernel.run(courses[k : k + LANES])[0][:, seen]
    return found

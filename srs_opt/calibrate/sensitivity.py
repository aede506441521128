"""Derivatives of a trial's motion: its steps repeated on the same mesh with one coordinate perturbed.

On a mesh that is kept the integration is a smooth function of the parameters, so that differences are exact
as the integration sees them; and the compiled steps take several coordinates at once, for a fifth of what
tangents cost. Delays need none of this: they shift the motion in time, so their derivative is minus the
velocity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from srs_opt.calibrate.fit_settings import DERIVATIVE
from srs_opt.calibrate.initial_pose import initial_pose
from srs_opt.calibrate.trial_simulation import Nodes
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import state_layout
from srs_opt.model.state import POSE, StateLayout
from srs_opt.simulate.integrate import step_kernel
from srs_opt.simulate.kernel import LANES, Course, Kernel
from srs_opt.simulate.rosenbrock import BODY_STATES


@dataclass(frozen=True)
class Variation:
    """Sensitivities of one trial at its nodes.

    Attributes
    ----------
    pose : array (nodes, 3, K)
    shape : array (nodes, N-1 or more, K)
        As `StateLayout.shape`.
    """

    pose: np.ndarray
    shape: np.ndarray


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
    layout, step = state_layout(structure), DERIVATIVE.perturbation * typical
    start, h = _start(structure, nodes), np.diff(nodes.time_s)
    same = start.size == nodes.start.size

    def course(x: np.ndarray, q: np.ndarray) -> Course:
        return Course(x, h, nodes.valve, q)

    courses = []
    for off, seed, turn in zip(step, seeds.T, (initial_pose(structure, p, heading_rad)[1] @ seeds).T):
        x = start.copy()
        # the tail stays at the origin, so that lengths and masses move the centre of mass at the start
        x[POSE] += off * turn
        courses.append(course(x, p + off * seed))
    # another structure integrates the actuators otherwise: what it makes of the nodes' motion comes first
    if not same:
        courses.insert(0, course(start, p))
    moved = _motions(step_kernel(structure), courses, layout)
    if same:
        unmoved = np.concatenate([nodes.body[:, :3], nodes.shape(layout)], axis=1)[..., None]
    else:
        unmoved, moved = moved[..., :1], moved[..., 1:]
    # one-sided: the error is first order in the step, whose size weighs it against rounding (`perturbation`)
    jacobian = (moved - unmoved) / step
    return Variation(jacobian[:, :3], jacobian[:, 3:])


def _start(structure: Structure, nodes: Nodes) -> np.ndarray:
    """Return the state at the first node as `structure` has it: memories that are new there are empty."""
    start = np.zeros(state_layout(structure).size)
    known = min(start.size, nodes.start.size)
    start[:known] = nodes.start[:known]
    return start


def onset(
    structure: Structure, nodes: Nodes, flexible: tuple[np.ndarray, np.ndarray], difference: float
) -> Variation:
    """Return the sensitivities of a rigid body's motion to the flexibility with which it begins to bend.

    To first order in the flexibility F the curvature lags the no-load one by d with t_r d' + d = F M, M the
    bending moment. Two bodies so stiff that nothing else is left, on the steps of the rigid one (the steps
    are implicit, of full order for bends that follow their load at once), differ by just that.

    Parameters
    ----------
    structure : Structure
        Of the compliant model.
    flexible : pair of array
        Its packed parameters for two flexibilities, `difference` apart.
    """
    layout = state_layout(structure)
    rigid = replace(layout, compliant=False, actuator_states=nodes.start.size - BODY_STATES)
    start, h = layout.adopt(nodes.start, rigid), np.diff(nodes.time_s)
    courses = [Course(start, h, nodes.valve, p) for p in flexible]
    moved = _motions(step_kernel(structure), courses, layout)
    jacobian = (moved[..., 1:] - moved[..., :1]) / difference
    return Variation(jacobian[:, :3], jacobian[:, 3:])


def _motions(kernel: Kernel, courses: Sequence[Course], layout: StateLayout) -> np.ndarray:
    """Return pose and shape of every course at all nodes, (nodes, 3 + N-1 or more, courses)."""
    seen = [*range(3), *layout.shape]
    found = np.empty((courses[0].h_s.size + 1, len(seen), len(courses)))
    found[0] = np.stack([c.x[seen] for c in courses], axis=1)
    for k in range(0, len(courses), LANES):
        found[1:, :, k : k + LANES] = kernel.run(courses[k : k + LANES])[0][:, seen]
    return found

"""Where a trial begins: the straight robot with its tail at the room's origin."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from srs_opt.geometry import turn_by
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build


@lru_cache(maxsize=8)
def _initial_pose_function(structure: Structure) -> ca.Function:
    parameters, m, _ = build(structure)
    heading = ca.SX.sym("heading")
    x, y = (ca.substitute(v[0], m.shape, ca.SX.zeros(m.shape.shape)) for v in (m.chain.x, m.chain.y))
    x, y = turn_by(ca.cos(heading), ca.sin(heading), x, y)
    pose = ca.vertcat(-x, -y, heading)
    p = parameters.vector
    return ca.Function("start", [p, heading], [pose, ca.jacobian(pose, p)])


def initial_pose(structure: Structure, p: np.ndarray, heading_rad: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the pose (3,) of the straight robot with its tail at the origin, and its derivative by p."""
    pose, jacobian = _initial_pose_function(structure)(p, heading_rad)
    return np.asarray(pose).ravel(), np.asarray(jacobian)

"""Coulomb friction of one wheel pair, low along and high across the wheels.

``per_axis``: each axis slides on its own, sgn smoothed as tanh(v/v_s).
``cone``: one force against the weighted sliding direction (Hu and Shelley; Alben).
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

FrictionLaw = Callable[[ca.SX, ca.SX, ca.SX], tuple[ca.SX, ca.SX]]


def per_axis(v_t: ca.SX, v_n: ca.SX, v_s: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the smoothed sliding directions along and across the wheel."""
    # one division for all links; at v_s friction has tanh(1) = 76 % of its full size
    steepness = 1 / v_s
    return ca.tanh(v_t * steepness), ca.tanh(v_n * steepness)


def cone(v_t: ca.SX, v_n: ca.SX, v_s: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return v/sqrt(v_t^2 + v_n^2 + v_s^2), the smoothed sliding direction of the cone law."""
    # v_s under the root keeps the law differentiable at rest
    inverse = 1 / ca.sqrt(v_t * v_t + v_n * v_n + v_s * v_s)
    return v_t * inverse, v_n * inverse


FRICTION_LAWS: dict[str, FrictionLaw] = {"per_axis": per_axis, "cone": cone}

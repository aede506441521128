"""Mesh refinement from the defect between nodes: where the polynomials disobey the equations of motion."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from srs_opt.gait_opt.collocation.layout import DEGREE, NODES, PRESSURE_UNIT_KPA, Mesh
from srs_opt.gait_opt.collocation.phases import Cuts
from srs_opt.gait_opt.collocation.point import BODY, point_functions
from srs_opt.gait_opt.collocation.program import Program, Solution
from srs_opt.gait_opt.settings import COLLOCATION

BETWEEN = np.array([0.08, 0.4, 0.85])  # places inside an element, away from its nodes
# of the local error with three Radau nodes per element
_ORDER = 4.0


def _basis() -> tuple[np.ndarray, np.ndarray]:
    """Return values and derivatives of the Lagrange basis (nodes 0, c1, c2, c3) at BETWEEN, (4, 3) each."""
    nodes = np.concatenate([[0.0], NODES])
    values, derivatives = [], []
    for j in range(DEGREE + 1):
        others = np.delete(nodes, j)
        polynomial = np.poly1d(others, r=True) / np.prod(nodes[j] - others)
        values.append(polynomial(BETWEEN))
        derivatives.append(polynomial.deriv()(BETWEEN))
    return np.array(values), np.array(derivatives)


def defects(p: Program, solution: Solution, parameters: np.ndarray, mesh: Mesh, robot: int = 0) -> np.ndarray:
    """Return the largest scaled defect of the body's velocity inside every element, (elements,).

    The defect is the difference between the polynomial's derivative and the equations, times the element's
    width: about the local error in units of the states' typical sizes.
    """
    layout, kind = p.layout, p.layout.kinds[robot]
    n, s = mesh.elements, kind.states
    sizes = np.cumsum([0, *p.parameter_sizes])
    half_width = parameters[sizes[2]]
    numbers, scale = (parameters[sizes[3 + 3 * robot + k] : sizes[4 + 3 * robot + k]] for k in range(2))
    x = solution.z[layout.states(robot)].reshape(n, DEGREE, s)
    # an element starts at the end of the one before, the first at the end of the cycle
    nodes = np.concatenate([np.roll(x[:, -1:], 1, axis=0), x], axis=1)
    values, derivatives = _basis()
    between = np.einsum("ejs,jb->ebs", nodes, values)
    derivative = np.einsum("ejs,jb->ebs", nodes, derivatives)
    width = np.diff(mesh.edges)
    at = mesh.edges[:-1, None] + width[:, None] * BETWEEN
    z = solution.z
    own = layout.start(robot)
    fixed = np.concatenate([z[own : own + 2], [z[0], PRESSURE_UNIT_KPA * z[1]], z[2 : 2 + layout.switches]])
    points = n * BETWEEN.size
    y = np.concatenate(
        [
            between.reshape(points, s),
            np.tile(fixed, (points, 1)),
            at.reshape(points, 1),
            np.repeat(width, BETWEEN.size)[:, None],
        ],
        axis=1,
    )
    function = point_functions(kind).value.map("value_between", "serial", points, [1, 2, 3], [])
    turns = parameters[sizes[5 + 3 * robot] : sizes[6 + 3 * robot]].reshape(n, DEGREE, kind.switches)
    turns = turns[:, : BETWEEN.size].reshape(points, kind.switches).T
    rates = np.asarray(function(y.T, scale, numbers, half_width, turns))[:s].T.reshape(n, BETWEEN.size, s)
    error: np.ndarray = np.abs(derivative - rates)[:, :, : min(3, BODY)].max(axis=(1, 2))
    return error


def refined_cuts(defect: np.ndarray, cuts: Cuts, tolerance: float) -> Cuts:
    """Return cuts with every element whose defect is above `tolerance` split into as many as should do."""
    # defects fall as width^4: so many parts bring one to the tolerance
    growth = np.clip(
        (np.maximum(defect, 1e-12) / tolerance) ** (1 / _ORDER), 1.0, COLLOCATION.largest_refinement
    )
    parts = iter(np.ceil(growth).astype(int))
    finer = []
    for ends in cuts:
        pieces = [np.linspace(a, b, next(parts) + 1)[:-1] for a, b in pairwise(ends)]
        finer.append(np.append(np.concatenate(pieces), 1.0))
    return tuple(finer)

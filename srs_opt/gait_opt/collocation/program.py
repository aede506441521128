"""The nonlinear program of one gait cycle: assembled from compiled point equations, solved by IPOPT."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from srs_opt.gait_opt.collocation.goal_rows import GOAL_NUMBERS, GoalKind, Times, goal_rows
from srs_opt.gait_opt.collocation.layout import ROBOT_UNKNOWNS, Layout, local_inputs, row_outputs
from srs_opt.gait_opt.collocation.point import PointKind, point_functions
from srs_opt.gait_opt.collocation.solver import Solver, nlp_solver
from srs_opt.gait_opt.collocation.sparse import Gather, hessian_gather, jacobian_gather, to_dm
from srs_opt.interrupts import signals_not_lost
from srs_opt.model.registry import build

IPOPT = Solver()


@dataclass(frozen=True)
class Solution:
    """Where the solver stopped.

    Attributes
    ----------
    z, multipliers_g, multipliers_z : arrays
    rows : array
        Values of the constraints.
    status : str
        The solver's own word.
    iterations : int
    converged : bool
    """

    z: np.ndarray
    multipliers_g: np.ndarray
    multipliers_z: np.ndarray
    rows: np.ndarray
    status: str
    iterations: int
    converged: bool


class Program:
    """One problem: kinds of equations, number of elements, kind of goal. Numbers come with each solve."""

    def __init__(self, layout: Layout, goal: GoalKind, times: Times | None = None) -> None:
        self.layout = layout
        self.times = times
        self.goal = goal_rows(layout, goal, times)
        head = [np.arange(layout.shared)]
        head += [layout.start(r) + np.arange(len(ROBOT_UNKNOWNS)) for r in range(len(layout.kinds))]
        self.head = np.concatenate(head)
        self._parts = [self._assemble(r) for r in range(len(layout.kinds))]
        self._solvers: dict[tuple[Any, ...], ca.Function] = {}
        self._build()

    def _assemble(self, robot: int) -> dict[str, Any]:
        layout, kind = self.layout, self.layout.kinds[robot]
        functions = point_functions(kind)
        inputs = local_inputs(layout, robot, None if self.times is None else self.times.matrix)
        outputs, fixed = row_outputs(layout, robot)
        points = layout.points
        last_two = np.tile([kind.locals - 2, kind.locals - 1], points)
        rows = np.arange(points).repeat(2) * kind.locals + last_two
        ones, shape = np.ones(2 * points), (points * kind.locals, 2 * points)
        place = sparse.csr_matrix((ones, (rows, np.arange(2 * points))), shape=shape)
        return {
            "functions": functions,
            "kind": kind,
            "inputs": to_dm(inputs),
            "place": to_dm(place),
            "outputs": to_dm(outputs),
            "outputs_t": to_dm(outputs.T),
            "fixed": to_dm(fixed),
            "jacobian": jacobian_gather(
                functions.jacobian_sparsity, points, inputs, outputs, sparse.coo_matrix(fixed)
            ),
            "hessian": hessian_gather(functions.hessian_sparsity, points, inputs),
            "rows": outputs.shape[0],
        }

    def _build(self) -> None:
        layout = self.layout
        z = ca.MX.sym("z", layout.size)
        self.parameter_sizes = [2 * layout.points, len(GOAL_NUMBERS) + 2 * len(layout.kinds), 1]
        for kind in layout.kinds:
            self.parameter_sizes += [
                build(kind.structure)[0].vector.numel(), kind.states, kind.switches * layout.points
            ]  # fmt: skip
        parameters = ca.MX.sym("p", sum(self.parameter_sizes))
        mesh, numbers, half_width, *rest = ca.vertsplit(
            parameters, np.cumsum([0, *self.parameter_sizes]).tolist()
        )
        self.row_counts = [part["rows"] for part in self._parts] + [self.goal.low.size]
        total = sum(self.row_counts)
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", total)
        rows, jacobians = [], []
        hessian = ca.MX(layout.size, layout.size)
        splits = ca.vertsplit(lam_g, np.cumsum([0, *self.row_counts]).tolist())
        for r, part in enumerate(self._parts):
            g, jac, hess = self._robot(part, z, mesh, [half_width, *rest[3 * r : 3 * r + 3]], splits[r])
            rows.append(g)
            jacobians.append(jac)
            hessian += hess
        head = z[self.head.tolist()]
        robots = ca.vertcat(*rest[0::3])
        g, jac, hess = self._goal_derivatives(head, numbers, robots, splits[-1])
        rows.append(g)
        spread = _selection(self.head, layout.size)
        jacobians.append(jac @ spread)
        # the upper triangle is all that IPOPT's interface reads
        hessian += ca.triu(spread.T @ hess @ spread)
        # IPOPT minimizes
        f = -z[layout.merit]
        gradient = ca.DM(layout.size, 1)
        gradient[layout.merit] = -1.0
        g, jac = ca.vertcat(*rows), ca.vertcat(*jacobians)
        names = ["x", "p"]
        self._nlp = {"x": z, "p": parameters, "f": f, "g": g}
        self._options = {
            "grad_f": ca.Function(
                "grad_f", [z, parameters], [f, ca.densify(gradient)], names, ["f", "grad:f:x"]
            ),
            "jac_g": ca.Function("jac_g", [z, parameters], [g, jac], names, ["g", "jac:g:x"]),
            "hess_lag": ca.Function(
                "hess_lag", [z, parameters, lam_f, lam_g], [hessian],
                ["x", "p", "lam:f", "lam:g"], ["triu:hess:gamma:x:x"],
            ),
        }  # fmt: skip
        self.rows = total
        self.evaluate = ca.Function("rows", [z, parameters], [g])

    def _robot(
        self, part: dict[str, Any], z: ca.MX, mesh: ca.MX, own: list[ca.MX], lam: ca.MX
    ) -> tuple[ca.MX, ca.MX, ca.MX]:
        kind: PointKind = part["kind"]
        points = self.layout.points
        y = ca.reshape(part["inputs"] @ z + part["place"] @ mesh, kind.locals, points)
        half_width, p, scale, turns = own
        turns = ca.reshape(turns, kind.switches, points)
        functions = part["functions"]

        def mapped(function: ca.Function) -> ca.Function:
            return function.map(f"{function.name()}_all", "serial", points, [1, 2, 3], [])

        value = ca.vec(mapped(functions.value)(y, scale, p, half_width, turns))
        g = part["outputs"] @ value + part["fixed"] @ z
        dense = mapped(functions.jacobian)(y, scale, p, half_width, turns)
        jacobian: Gather = part["jacobian"]
        multipliers = ca.reshape(part["outputs_t"] @ lam, kind.outputs, points)
        curved = mapped(functions.hessian)(y, scale, p, half_width, turns, multipliers)
        hessian: Gather = part["hessian"]
        return g, jacobian(_nonzeros(dense)), hessian(_nonzeros(curved))

    def _goal_derivatives(
        self, head: ca.MX, numbers: ca.MX, robots: ca.MX, lam: ca.MX
    ) -> tuple[ca.MX, ca.MX, ca.MX]:
        h, n, m = ca.SX.sym("h", self.head.size), ca.SX.sym("n", numbers.numel()), ca.SX.sym("m", lam.numel())
        p = ca.SX.sym("p", robots.numel())
        rows = self.goal.function(h, n, p)
        first = ca.Function("goal_jacobian", [h, n, p], [rows, ca.jacobian(rows, h)])
        second = ca.Function("goal_bend", [h, n, p, m], [ca.hessian(ca.dot(m, rows), h)[0]])
        g, jac = first(head, numbers, robots)
        return g, jac, second(head, numbers, robots, lam)

    def _solver(self, solver: Solver, stage: Mapping[str, Any]) -> ca.Function:
        # made once per set of options: making a solver is work that a solve need not repeat
        key = (solver, tuple(sorted(stage.items())))
        if key not in self._solvers:
            self._solvers[key] = nlp_solver(solver, stage, self._nlp, self._options)
        return self._solvers[key]

    def solve(
        self,
        z: np.ndarray,
        parameters: np.ndarray,
        bounds_z: tuple[np.ndarray, np.ndarray],
        bounds_g: tuple[np.ndarray, np.ndarray],
        warm: Solution | None = None,
        options: Mapping[str, Any] | None = None,
        solver: Solver = IPOPT,
    ) -> Solution:
        """Solve from `z`; with `warm`, multipliers are taken over and the barrier starts low.

        `options` are IPOPT's for this stage; those of `solver` go before them.
        """
        arguments = {
            "x0": z, "p": parameters,
            "lbx": bounds_z[0], "ubx": bounds_z[1], "lbg": bounds_g[0], "ubg": bounds_g[1],
        }  # fmt: skip
        changes = dict(options or {})
        if warm is not None:
            changes = {
                # multipliers of a near solution only help if the barrier starts low and bounds do not push
                # away
                "warm_start_init_point": "yes", "mu_init": 1e-4, "warm_start_bound_push": 1e-6,
                "warm_start_mult_bound_push": 1e-6, "mu_strategy": "monotone", **changes,
            }  # fmt: skip
            arguments |= {"lam_g0": warm.multipliers_g, "lam_x0": warm.multipliers_z}
        function = self._solver(solver, changes)
        with signals_not_lost():
            out = function(**arguments)
        stats = function.stats()
        found = np.asarray(out["x"]).ravel()
        return Solution(
            found if np.isfinite(found).all() else z,  # a solver that lost its way led nowhere
            np.asarray(out["lam_g"]).ravel(),
            np.asarray(out["lam_x"]).ravel(),
            np.asarray(out["g"]).ravel(),
            str(stats.get("return_status", "")),
            int(stats.get("iter_count", 0)),
            bool(stats["success"]),
        )


def _selection(indices: np.ndarray, size: int) -> ca.DM:
    ones = np.ones(indices.size)
    return to_dm(sparse.csr_matrix((ones, (np.arange(indices.size), indices)), shape=(indices.size, size)))


def _nonzeros(matrix: ca.MX) -> ca.MX:
    return matrix.nz[:] if matrix.nnz() != matrix.numel() else ca.vec(matrix)


@lru_cache(maxsize=32)
def program(layout: Layout, goal: GoalKind) -> Program:
    """Return the problem with a fixed mesh; built once per process."""
    return Program(layout, goal)

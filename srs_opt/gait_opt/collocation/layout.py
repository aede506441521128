"""Where everything stands in the problem's vector, and the mesh of the cycle."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy import sparse

from srs_opt.gait_opt.collocation.point import QUADRATURES, PointKind

DEGREE = 3
NODES = np.array(ca.collocation_points(DEGREE, "radau"))
_C, _D, _B = (np.asarray(v) for v in ca.collocation_coeff(list(NODES)))
DIFFERENTIATION = _C  # (DEGREE + 1, DEGREE): row 0 is the element's start
WEIGHTS = _B.ravel()

PRESSURE_UNIT_KPA = 50.0
ENVELOPE_UNIT_M = 0.05
ROBOT_UNKNOWNS = ("speed", "turn_rate", "work", "left", "right")


@dataclass(frozen=True)
class Mesh:
    """Elements of the cycle, as fractions of the period.

    Attributes
    ----------
    edges : array (n + 1,)
        From 0 to 1.
    """

    edges: np.ndarray

    @staticmethod
    def uniform(n: int) -> Mesh:
        """Return `n` equal elements."""
        return Mesh(np.linspace(0.0, 1.0, n + 1))

    @property
    def elements(self) -> int:
        """Number of elements."""
        return self.edges.size - 1

    def points(self) -> np.ndarray:
        """Return the collocation points, (3 n,)."""
        instants: np.ndarray = (self.edges[:-1, None] + np.diff(self.edges)[:, None] * NODES).ravel()
        return instants


@dataclass(frozen=True)
class Layout:
    """Unknowns: frequency, pressure, switches, merit; then per robot its five unknowns and its states.

    Attributes
    ----------
    kinds : tuple of PointKind, one per robot
    elements : int
    """

    kinds: tuple[PointKind, ...]
    elements: int

    @property
    def switches(self) -> int:
        """Number of switch times (relaxed: valve levels, element by element)."""
        first = self.kinds[0]
        return first.switches * (self.elements if first.relaxed else 1)

    @property
    def merit(self) -> int:
        """Index of the merit (worst over the robots)."""
        return 2 + self.switches

    @property
    def shared(self) -> int:
        """Number of unknowns that all robots share."""
        return 3 + self.switches

    def start(self, robot: int) -> int:
        """Index of the first unknown of a robot."""
        sizes = [len(ROBOT_UNKNOWNS) + k.states * DEGREE * self.elements for k in self.kinds[:robot]]
        return self.shared + sum(sizes)

    def unknown(self, robot: int, name: str) -> int:
        """Index of one of a robot's five unknowns."""
        return self.start(robot) + ROBOT_UNKNOWNS.index(name)

    def states(self, robot: int) -> slice:
        """Return the place of a robot's states, point by point."""
        first = self.start(robot) + len(ROBOT_UNKNOWNS)
        return slice(first, first + self.kinds[robot].states * DEGREE * self.elements)

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.start(len(self.kinds))

    @property
    def points(self) -> int:
        """Collocation points per robot."""
        return DEGREE * self.elements


def local_inputs(layout: Layout, robot: int, times: sparse.csr_matrix | None = None) -> sparse.csr_matrix:
    """Return the matrix from the problem's unknowns to a robot's local unknowns, (points * locals, size).

    `times` (2 * points, switches), place and width of every point by the switch times, for meshes whose
    phases end at switches; without, they are constants of the mesh.
    """
    kind = layout.kinds[robot]
    n, width, points = kind.states, kind.locals, layout.points
    rows, columns, data = [], [], []

    def put(local: int, column: np.ndarray, value: float) -> None:
        rows.append(np.arange(points) * width + local)
        columns.append(np.broadcast_to(column, (points,)))
        data.append(np.full(points, value))

    first = layout.states(robot).start
    for i in range(n):
        put(i, first + np.arange(points) * n + i, 1.0)
    put(n, np.array(layout.unknown(robot, "speed")), 1.0)
    put(n + 1, np.array(layout.unknown(robot, "turn_rate")), 1.0)
    put(n + 2, np.array(0), 1.0)
    put(n + 3, np.array(1), PRESSURE_UNIT_KPA)
    for i in range(kind.switches):
        element = np.arange(points) // DEGREE * kind.switches
        put(n + 4 + i, 2 + i + (element if kind.relaxed else np.array(0)), 1.0)
    matrix = sparse.coo_matrix(
        (np.concatenate(data), (np.concatenate(rows), np.concatenate(columns))),
        shape=(points * width, layout.size),
    )
    if times is not None:
        t = sparse.coo_matrix(times)
        point, which = t.row // 2, t.row % 2
        # place and width are the last two of a point's local unknowns
        extra = sparse.coo_matrix((t.data, (point * width + width - 2 + which, 2 + t.col)), matrix.shape)
        matrix = matrix + extra
    return sparse.csr_matrix(matrix)


def row_outputs(layout: Layout, robot: int) -> tuple[sparse.csr_matrix, sparse.csr_matrix]:
    """Return (outputs, fixed): a robot's rows are ``outputs @ point outputs + fixed @ unknowns``.

    Rows: collocation (all states and points, zero), quadratures (zero), then per path output and element
    end: reach minus left, reach plus right (for the envelope), curvature.
    """
    kind, n = layout.kinds[robot], layout.elements
    s, o = kind.states, kind.outputs
    first = layout.states(robot).start
    e, i, j = (v.ravel() for v in np.meshgrid(np.arange(n), np.arange(DEGREE), np.arange(s), indexing="ij"))
    # a defect: sum_k D_ki x_k - (element's duration) x'(point i), in units of the state
    row = (e * DEGREE + i) * s + j
    out_rows, out_columns, out_data = [row], [(e * DEGREE + i) * o + j], [np.full(row.size, -1.0)]
    fix_rows, fix_columns, fix_data = [], [], []
    for k in range(DEGREE + 1):
        # the last Radau node is the element's end, so the next starts there; the first one after the last
        # closes the cycle
        source = ((e - 1) % n) * DEGREE + DEGREE - 1 if k == 0 else e * DEGREE + k - 1
        fix_rows.append(row)
        fix_columns.append(first + source * s + j)
        fix_data.append(DIFFERENTIATION[k, i])
    rows = row.size
    for q in range(QUADRATURES):
        point = np.arange(layout.points)
        out_rows.append(np.full(point.size, rows + q))
        out_columns.append(point * o + s + q)
        # Radau quadrature; the element's width is in the point's outputs already
        out_data.append(np.tile(WEIGHTS, n))
    # the third quadrature is the friction work itself, the first two means that vanish
    fix_rows.append(np.array([rows + 2]))
    fix_columns.append(np.array([layout.unknown(robot, "work")]))
    fix_data.append(np.array([-1.0]))
    rows += QUADRATURES
    ends = np.arange(n) * DEGREE + DEGREE - 1
    reach = 2 * kind.structure.links - 1 if kind.envelope else 0
    for path in range(kind.paths):
        # reach to the left at most left, to the right (negative) at most right
        sides = (("left", -1.0), ("right", 1.0)) if path < reach else ((None, 0.0),)
        for side, sign in sides:
            mine = rows + np.arange(n)
            out_rows.append(mine)
            out_columns.append(ends * o + s + QUADRATURES + path)
            out_data.append(np.ones(n))
            if side is not None:
                fix_rows.append(mine)
                fix_columns.append(np.full(n, layout.unknown(robot, side)))
                fix_data.append(np.full(n, sign * ENVELOPE_UNIT_M))
            rows += n
    cat = np.concatenate
    outputs = sparse.csr_matrix(
        (cat(out_data), (cat(out_rows), cat(out_columns))), shape=(rows, layout.points * o)
    )
    fixed = sparse.csr_matrix((cat(fix_data), (cat(fix_rows), cat(fix_columns))), shape=(rows, layout.size))
    return outputs, fixed

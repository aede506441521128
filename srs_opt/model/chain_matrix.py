"""Matrices of an open chain: rank-structured, so that products and solutions take time linear in the links.

Link j moves all links ahead of it by one vector. So the entries of the mass matrix, and of the derivatives of
the equations of motion, are products of short vectors, p_i . q_j below the diagonal and g_i . h_j above it,
beside local terms on three diagonals (springs). LU factors of such a matrix have the same form (without
pivoting: see `ChainMatrix.solver`). Rows p, g are those of the chain and shared by all its matrices.

Source of the technique: Y. Eidelman and I. Gohberg, Integral Equations and Operator Theory 34 (1999) 293.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca


@dataclass(frozen=True)
class Rows:
    """Row vectors of a chain's matrices, entry i (1, r): below the diagonal (rank r), above it (rank s)."""

    lower: list[ca.SX]
    upper: list[ca.SX]


@dataclass(frozen=True)
class ChainMatrix:
    """A square matrix of order n.

    Attributes
    ----------
    rows : Rows
    lower, upper : lists of SX (r, 1) and (s, 1)
        Column vectors below and above the diagonal.
    diagonal, below, above : lists of SX
        The diagonal, whole, and what the two beside it have besides the products.
    """

    rows: Rows
    lower: list[ca.SX]
    upper: list[ca.SX]
    diagonal: list[ca.SX]
    below: list[ca.SX]
    above: list[ca.SX]

    @property
    def size(self) -> int:
        """Order of the matrix."""
        return len(self.diagonal)

    def plus(self, other: ChainMatrix, factor: ca.SX) -> ChainMatrix:
        """Return this matrix plus `factor` times another of the same chain."""
        parts = (
            [a + factor * b for a, b in zip(mine, others)]
            for mine, others in (
                (self.lower, other.lower),
                (self.upper, other.upper),
                (self.diagonal, other.diagonal),
                (self.below, other.below),
                (self.above, other.above),
            )
        )
        return ChainMatrix(self.rows, *parts)

    def times(self, x: ca.SX) -> ca.SX:
        """Return the product with a vector (n, 1)."""
        n, p, g = self.size, self.rows.lower, self.rows.upper
        y = [self.diagonal[i] * x[i] for i in range(n)]
        behind, ahead = ca.SX(*self.lower[0].shape), ca.SX(*self.upper[0].shape)
        for i in range(1, n):
            behind = behind + self.lower[i - 1] * x[i - 1]
            y[i] += p[i] @ behind + self.below[i - 1] * x[i - 1]
        for i in reversed(range(n - 1)):
            ahead = ahead + self.upper[i + 1] * x[i + 1]
            y[i] += g[i] @ ahead + self.above[i] * x[i + 1]
        return ca.vertcat(*y)

    def dense(self) -> ca.SX:
        """Return all entries, (n, n)."""
        return ca.horzcat(*[self.times(column) for column in ca.horzsplit(ca.SX(ca.DM.eye(self.size)))])

    def solver(self) -> Callable[[ca.SX], ca.SX]:
        """Return the function that solves for a right-hand side (n, 1), the matrix factorized once.

        Without pivoting: for matrices whose symmetric part is positive definite. Implicit steps of equations
        of motion lead to such: mass, damping and stiffness are, and what remains is small at the step sizes
        that accuracy allows.
        """
        n, p, g = self.size, self.rows.lower, self.rows.upper
        state = ca.SX(self.lower[0].shape[0], self.upper[0].shape[0])  # sum of q g over what is eliminated
        inverse: list[ca.SX] = []
        columns: list[ca.SX] = []
        rows: list[ca.SX] = []
        below: list[ca.SX] = []
        for i in range(n):
            row, column, pivot = p[i] @ state, state @ self.upper[i], self.diagonal[i]
            if i:
                column = column + columns[-1] * self.above[i - 1]
                pivot = pivot - below[-1] * (rows[-1] @ self.upper[i] + self.above[i - 1])
                row = row + below[-1] * rows[-1]
            # the pivot of row i after all eliminations: only reciprocals are kept, so that solving divides by
            # nothing
            inverse.append(1 / (pivot - p[i] @ column))
            columns.append((self.lower[i] - column) * inverse[i])
            rows.append(g[i] - row)
            if i < n - 1:
                below.append(self.below[i] * inverse[i])
            # one r x s matrix carries what the eliminated rows do to all that follow
            state = state + columns[-1] @ rows[-1]

        def solve(right: ca.SX) -> ca.SX:
            x = ca.vertsplit(ca.densify(right))
            behind, ahead = ca.SX(*self.lower[0].shape), ca.SX(*self.upper[0].shape)
            for i in range(1, n):
                behind = behind + columns[i - 1] * x[i - 1]
                x[i] = x[i] - p[i] @ behind - below[i - 1] * x[i - 1]
            x[-1] = x[-1] * inverse[-1]
            for i in reversed(range(n - 1)):
                ahead = ahead + self.upper[i + 1] * x[i + 1]
                x[i] = (x[i] - rows[i] @ ahead - self.above[i] * x[i + 1]) * inverse[i]
            return ca.vertcat(*x)

        return solve

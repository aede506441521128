"""Linear systems as straight-line expressions."""

from __future__ import annotations

import casadi as ca


class LU:
    """An LU factorization without pivoting, for matrices whose symmetric part is positive definite.

    That is what implicit steps of the equations of motion lead to: mass, friction's and the material's
    damping and stiffness are positive definite, what remains is small at the step sizes that accuracy allows.
    """

    def __init__(self, matrix: ca.SX) -> None:
        self._n = n = matrix.shape[0]
        rows = [ca.densify(matrix[i, :]) for i in range(n)]
        self._inverse: list[ca.SX] = []
        self._lower: list[list[ca.SX]] = [[] for _ in range(n)]
        for k in range(n):
            self._inverse.append(1 / rows[k][k])
            for i in range(k + 1, n):
                factor = rows[i][k] * self._inverse[k]
                self._lower[i].append(factor)
                rows[i][k + 1 :] = rows[i][k + 1 :] - factor * rows[k][k + 1 :]
        self._upper = rows

    def solve(self, right: ca.SX) -> ca.SX:
        """Return the solution for a right-hand side (n, 1)."""
        z = ca.vertsplit(ca.densify(right))
        for i in range(self._n):
            for k, factor in enumerate(self._lower[i]):
                z[i] -= factor * z[k]
        for i in reversed(range(self._n)):
            for k in range(i + 1, self._n):
                z[i] -= self._upper[i][k] * z[k]
            z[i] *= self._inverse[i]
        return ca.vertcat(*z)

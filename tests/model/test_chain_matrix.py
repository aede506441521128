"""Products, sums and solutions of rank-structured matrices against dense ones."""

import casadi as ca
import numpy as np
import pytest

from srs_opt.model.chain_matrix import ChainMatrix, Rows


def random_matrix(rng, n, rank, rows=None):
    def vectors(*shape):
        return [ca.SX(ca.DM(rng.normal(size=shape))) for _ in range(n)]

    rows = rows or Rows(vectors(1, rank), vectors(1, 2))
    diagonal = [ca.SX(float(v)) for v in rng.normal(size=n) + 25]
    beside = [[ca.SX(float(v)) for v in rng.normal(size=n - 1)] for _ in range(2)]
    return ChainMatrix(rows, vectors(rank, 1), vectors(2, 1), diagonal, *beside)


def dense(m):
    """From the definition, entry by entry."""
    n, full = m.size, np.zeros((m.size, m.size))
    for i in range(n):
        full[i, i] = float(m.diagonal[i])
        for j in range(i):
            full[i, j] = float(m.rows.lower[i] @ m.lower[j]) + (float(m.below[j]) if i == j + 1 else 0.0)
            full[j, i] = float(m.rows.upper[j] @ m.upper[i]) + (float(m.above[j]) if i == j + 1 else 0.0)
    return full


@pytest.mark.parametrize(("n", "rank"), [(2, 2), (5, 4), (12, 6), (40, 4)])
def test_products_and_solutions(n, rank):
    rng = np.random.default_rng(n)
    matrix = random_matrix(rng, n, rank)
    full, x = dense(matrix), rng.normal(size=n)
    np.testing.assert_allclose(np.array(ca.DM(matrix.dense())), full, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(np.array(ca.DM(matrix.times(ca.SX(ca.DM(x))))).ravel(), full @ x, rtol=1e-10)
    solution = np.array(ca.DM(matrix.solver()(ca.SX(ca.DM(x))))).ravel()
    np.testing.assert_allclose(full @ solution, x, rtol=1e-8, atol=1e-9)


def test_sums_share_their_rows():
    rng = np.random.default_rng(0)
    one = random_matrix(rng, 6, 4)
    other = random_matrix(rng, 6, 4, one.rows)
    both = one.plus(other, ca.SX(-0.5))
    np.testing.assert_allclose(dense(both), dense(one) - 0.5 * dense(other), rtol=1e-12, atol=1e-12)


def test_work_grows_with_the_order():
    def operations(n):
        x = ca.SX.sym("x", n)
        a = ca.SX.sym("a", 20, n)
        rows = Rows([a[:4, i].T for i in range(n)], [a[4:6, i].T for i in range(n)])
        lower, upper = [a[6:10, i] for i in range(n)], [a[10:12, i] for i in range(n)]
        three = [[a[k, i] for i in range(n - (k > 12))] for k in (12, 13, 14)]
        return ca.Function(
            "f", [a, x], [ChainMatrix(rows, lower, upper, *three).solver()(x)]
        ).n_instructions()

    assert operations(64) < 2.1 * operations(32)

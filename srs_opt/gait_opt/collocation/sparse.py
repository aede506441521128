"""Constant sparse maps from derivatives at points to those of the whole problem (A chain rule, once)."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy import sparse


@dataclass(frozen=True)
class Gather:
    """A sparsity pattern and the linear map that fills it from the points' nonzeros.

    Attributes
    ----------
    sparsity : casadi.Sparsity
    matrix : casadi.DM (nnz of the pattern, nonzeros of all points)
    constant : casadi.DM (nnz of the pattern, 1)
    """

    sparsity: ca.Sparsity
    matrix: ca.DM
    constant: ca.DM

    def __call__(self, nonzeros: ca.MX) -> ca.MX:
        """Return the sparse matrix for the points' nonzeros."""
        return ca.MX(self.sparsity, ca.mtimes(self.matrix, nonzeros) + self.constant)


def to_dm(matrix: sparse.spmatrix) -> ca.DM:
    """Return a scipy sparse matrix as casadi's."""
    m = sparse.csc_matrix(matrix)
    m.sort_indices()
    pattern = ca.Sparsity(m.shape[0], m.shape[1], m.indptr.tolist(), m.indices.tolist())
    return ca.DM(pattern, m.data.tolist())


def block_coordinates(pattern: ca.Sparsity, blocks: int) -> tuple[np.ndarray, np.ndarray]:
    """Return row and column of every nonzero of `blocks` equal blocks on a diagonal."""
    rows, columns = (np.asarray(v) for v in pattern.get_triplet())
    height, width = pattern.shape
    offset = np.repeat(np.arange(blocks), rows.size)
    return np.tile(rows, blocks) + offset * height, np.tile(columns, blocks) + offset * width


def _pairs(
    rows: np.ndarray, columns: np.ndarray, left: sparse.csr_matrix, right: sparse.csr_matrix
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Expand entries (o, y) through left[o, g] and right[y, z]: arrays g, z, coefficient, entry."""
    entry = np.arange(rows.size)
    reach_left, reach_right = np.diff(left.indptr)[rows], np.diff(right.indptr)[columns]
    count = reach_left * reach_right
    entry = np.repeat(entry, count)
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    width = reach_right[entry]
    a = left.indptr[rows[entry]] + within // np.maximum(width, 1)
    b = right.indptr[columns[entry]] + within % np.maximum(width, 1)
    return left.indices[a], right.indices[b], left.data[a] * right.data[b], entry


def _gather(
    shape: tuple[int, int],
    r: np.ndarray,
    c: np.ndarray,
    coefficient: np.ndarray,
    entry: np.ndarray,
    entries: int,
    fixed: sparse.coo_matrix,
) -> Gather:
    # column by column, the order of CasADi's nonzeros
    keys = np.concatenate([c * shape[0] + r, fixed.col * shape[0] + fixed.row]).astype(np.int64)
    # contributions that meet in one entry add up in the matrix below
    unique, place = np.unique(keys, return_inverse=True)
    column, row = np.divmod(unique, shape[0])
    indptr = np.concatenate([[0], np.cumsum(np.bincount(column, minlength=shape[1]))])
    pattern = ca.Sparsity(shape[0], shape[1], indptr.tolist(), row.tolist())
    matrix = sparse.coo_matrix((coefficient, (place[: r.size], entry)), shape=(unique.size, entries))
    constant = np.bincount(place[r.size :], weights=fixed.data, minlength=unique.size)
    return Gather(pattern, to_dm(matrix), ca.DM(constant))


def jacobian_gather(
    pattern: ca.Sparsity,
    points: int,
    inputs: sparse.csr_matrix,
    outputs: sparse.csr_matrix,
    fixed: sparse.coo_matrix,
) -> Gather:
    """Return the map for ``outputs @ blockdiag(J) @ inputs + fixed``.

    Parameters
    ----------
    pattern : Sparsity of one point's Jacobian.
    inputs : (points * y, z)
        How local unknowns follow from the problem's.
    outputs : (g, points * o)
        How rows are made from the points' outputs.
    fixed : (g, z)
        Constant part.
    """
    rows, columns = block_coordinates(pattern, points)
    left = sparse.csr_matrix(outputs.T)
    g, z, coefficient, entry = _pairs(rows, columns, left, sparse.csr_matrix(inputs))
    return _gather(fixed.shape, g, z, coefficient, entry, rows.size, fixed)


def hessian_gather(
    pattern: ca.Sparsity, points: int, inputs: sparse.csr_matrix, fixed: ca.Sparsity | None = None
) -> Gather:
    """Return the map for the upper triangle of ``inputs.T @ blockdiag(H) @ inputs``.

    `pattern` is the lower triangle of one point's Hessian.
    """
    rows, columns = block_coordinates(pattern, points)
    csr = sparse.csr_matrix(inputs)
    r, c, coefficient, entry = _pairs(rows, columns, csr, csr)
    # an entry off the diagonal of a triangle stands for two of the symmetric block
    mirrored = rows[entry] != columns[entry]
    r, c = np.concatenate([r, c[mirrored]]), np.concatenate([c, r[mirrored]])
    coefficient = np.concatenate([coefficient, coefficient[mirrored]])
    entry = np.concatenate([entry, entry[mirrored]])
    upper = r <= c
    size = inputs.shape[1]
    empty = sparse.coo_matrix((size, size))
    return _gather((size, size), r[upper], c[upper], coefficient[upper], entry[upper], rows.size, empty)

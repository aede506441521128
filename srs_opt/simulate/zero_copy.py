"""A CasADi function called over and over without copying: half the cost of a block is the call itself."""

from __future__ import annotations

import threading
from functools import lru_cache

import casadi as ca
import numpy as np

_building = threading.RLock()  # symbolic work and buffers are made by one thread at a time


class ZeroCopy(threading.local):
    """A function with its own argument and result arrays, separate ones in every thread.

    Arrays are (columns, rows): a CasADi matrix of shape (rows, columns) read in C order. Write into
    ``arguments[i]``, call `evaluate`, read ``results[i]`` (copy what must survive the next call).
    `threading.local` calls ``__init__`` again in each thread that uses the object.
    """

    def __init__(self, function: ca.Function) -> None:
        with _building:
            self._function = _dense(function)
            self._buffer, self.evaluate = self._function.buffer()
        f = self._function
        self.arguments = [np.zeros((f.size2_in(i), f.size1_in(i))) for i in range(f.n_in())]
        self.results = [np.zeros((f.size2_out(i), f.size1_out(i))) for i in range(f.n_out())]
        for i, array in enumerate(self.arguments):
            self._buffer.set_arg(i, memoryview(array))  # type: ignore[arg-type]
        for i, array in enumerate(self.results):
            self._buffer.set_res(i, memoryview(array))  # type: ignore[arg-type]


@lru_cache(maxsize=64)
def _dense(function: ca.Function) -> ca.Function:
    """Return the function with dense arguments and results, which its buffers then are."""
    dense_in = all(function.nnz_in(i) == function.numel_in(i) for i in range(function.n_in()))
    dense_out = all(function.nnz_out(i) == function.numel_out(i) for i in range(function.n_out()))
    if dense_in and dense_out:
        return function
    inputs = [ca.MX.sym(f"i{i}", *function.size_in(i)) for i in range(function.n_in())]
    return ca.Function("dense", inputs, [ca.densify(output) for output in function.call(inputs)])


@lru_cache(maxsize=64)
def zero_copy(function: ca.Function) -> ZeroCopy:
    """Return the function with arrays that it reads and writes in place."""
    return ZeroCopy(function)

"""A compiled function at many nodes in one call."""

from __future__ import annotations

import casadi as ca
import numpy as np

from srs_opt.simulate.zero_copy import zero_copy

MAP = 64  # nodes per call of the compiled functions


def mapped(single: ca.Function, repeated: tuple[int, ...]) -> ca.Function:
    """Map a function over MAP nodes with some inputs the same for all."""
    inputs = [
        ca.MX.sym(single.name_in(i), single.size1_in(i), 1 if i in repeated else MAP)
        for i in range(single.n_in())
    ]
    full = [ca.repmat(v, 1, MAP) if i in repeated else v for i, v in enumerate(inputs)]
    return ca.Function("mapped", inputs, single.map(MAP).call(full))


def evaluate(function: ca.Function, moving: tuple[np.ndarray, ...], *fixed: np.ndarray) -> list[np.ndarray]:
    """Evaluate a mapped function at all rows of `moving`; outputs have one row per node."""
    call = zero_copy(function)
    for argument, value in zip(call.arguments[len(moving) :], fixed):
        argument[0] = value
    n = moving[0].shape[0]
    out = [np.empty((n, result.shape[1])) for result in call.results]
    for k in range(0, n, MAP):
        count = min(MAP, n - k)
        for argument, value in zip(call.arguments, moving):
            # columns beyond hold values of an earlier call, whose results nobody reads
            argument[:count] = value[k : k + count]
        call.evaluate()
        for whole, part in zip(out, call.results):
            whole[k : k + count] = part[:count]
    return out

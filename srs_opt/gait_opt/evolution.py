"""CMA-ES (the package `cma`) as all searches of this project run it: one loop, quiet, reproducible."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

import numpy as np

T = TypeVar("T")
# A motion that cannot be integrated has an infinite cost; cma wants finite ones, and ranks are all it uses.
_WORST = 1e6


def evolution(
    decode: Callable[[list[np.ndarray]], list[T]],
    cost: Callable[[list[T]], Sequence[float]],
    middle: np.ndarray,
    spread: np.ndarray | float,
    *,
    seed: int | np.random.Generator,
    **options: Any,
) -> Iterator[tuple[list[T], Sequence[float]]]:
    """Yield the members of one generation after the other, with their costs, until the population is at rest.

    Parameters
    ----------
    decode : callable
        Gene vectors -> members (gaits, plans ...).
    cost : callable
        Members -> costs, the less the better; infinity is allowed.
    middle : array (n,)
        Of the first generation.
    spread : array (n,) or float
        Standard deviations of the first generation.
    seed : int or Generator
        What draws: numbers are the same however many processes simulate.
    options
        Of `cma`: ``popsize``, ``maxiter``, ``maxfevals``, ``tolfun``.
    """
    import cma

    if isinstance(seed, np.random.Generator):
        generator = seed
        drawing: dict[str, Any] = {
            "seed": math.nan,
            "randn": lambda *shape: generator.standard_normal(shape),
        }
    else:
        drawing = {"seed": seed}
    sizes = {} if np.isscalar(spread) else {"CMA_stds": spread}
    size = float(spread) if np.isscalar(spread) else 1.0  # type: ignore[arg-type]
    strategy = cma.CMAEvolutionStrategy(middle, size, {**options, **sizes, **drawing, "verbose": -9})
    while not strategy.stop():
        genes = strategy.ask()
        members = decode(genes)
        costs = cost(members)
        strategy.tell(genes, [min(value, _WORST) for value in costs])
        yield members, costs

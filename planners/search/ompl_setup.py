"""What all OMPL planners share: quiet logs, seeds, counted iterations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def seeded(seed: int) -> None:
    """Silence OMPL and seed its random numbers (a seed of 0 would mean the clock)."""
    from ompl import util

    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(seed + 1)


def counted(iterations: int, done: Callable[[], bool] = lambda: False) -> Any:
    """Return a termination condition that counts: the same seed then gives the same answer.

    Planners ask it once or a few times per iteration; a clock would make results depend on the machine.
    """
    from ompl import base

    asked = 0

    def stop() -> bool:
        nonlocal asked
        asked += 1
        return asked > iterations or done()

    return base.PlannerTerminationCondition(stop)

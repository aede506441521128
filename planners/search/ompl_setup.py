"""What all OMPL planners share: quiet logs, seeds, counted iterations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from srs_opt.errors import InputError
from srs_opt.interrupts import signals_deferred

T = TypeVar("T")
MISSING = "OMPL is not installed here (it has no wheel for Windows and older macOS)"


def has_ompl() -> bool:
    """Whether OMPL can be imported."""
    try:
        import ompl  # noqa: F401
    except ImportError:
        return False
    return True


def require_ompl() -> None:
    """Refuse to go on without OMPL.

    Raises
    ------
    InputError
        If it is not installed.
    """
    if not has_ompl():
        raise InputError(f"{MISSING}; --planner lattice works without it")


def ompl_classes(module: str) -> dict[str, type]:
    """Return the planners of `ompl.control` or `ompl.geometric` by their names in lower case.

    Raises
    ------
    InputError
        If OMPL is not installed.
    """
    require_ompl()
    import ompl.base
    import ompl.control
    import ompl.geometric

    found = [v for v in vars(getattr(ompl, module)).values() if isinstance(v, type)]
    return {v.__name__.lower(): v for v in found if issubclass(v, ompl.base.Planner) and _made_of_space(v)}


def _made_of_space(planner: type) -> bool:
    """Whether a class can be made of a space; some have no constructor in Python, or ask for more."""
    signature = str(vars(planner)["__init__"].__doc__)
    return "SpaceInformation" in signature and "Decomposition" not in signature


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


def until_a_signal(call: Callable[[Callable[[], bool]], T]) -> T:
    """Return what a call returns that is told when to stop: at a signal as well.

    Ctrl-C and SIGTERM take effect when the call has returned: OMPL's C++ lets exceptions out of Python's
    callbacks late, or never, and its objects do not outlive each other in the order of a traceback.
    """
    with signals_deferred() as waiting:
        return call(waiting)

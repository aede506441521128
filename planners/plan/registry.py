"""Every planner by its name, under one protocol: ours, OMPL's, and planners of one's own.

A plain search takes a `Problem` and an `Effort` and returns the gaits of a way, a cycle each. For OMPL every
planner is an `ompl.base.Planner` on the set-up of `planners.search.ompl_problem`: OMPL's own as they are,
plain searches through an adapter. Planners do not make certificates.

Examples
--------
A file for ``plan --plugin mine.py --planner mine``::

    from planners.plan.registry import register_planner

    def search(problem, effort):
        ...
        return [0, 0, 3]  # indices into problem.gaits.gaits, or None

    register_planner("mine", search)
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

from planners.plan.settings import MENDING
from planners.plan.solve import LatticeSolver, RunSolver
from planners.search.lattice import LATTICE
from planners.search.ompl_control import MakePlanner, as_ompl_planner, run_planner
from planners.search.ompl_geometric import search_geometric
from planners.search.ompl_problem import CycleSetup
from planners.search.ompl_setup import ompl_classes
from planners.search.problem import Problem
from srs_opt.errors import InputError

ALIASES = {"kpiece": "kpiece1"}
CURVES = ("dubins", "rs")
# what `auto` asks, in this order; OMPL's only where our own searches have found nothing
OURS = ("lattice", "runs", "fine")
OMPLS = ("dubins-rrtconnect", "rs-rrtconnect", "kpiece1", "est", "rrt")
UNUSABLE = ("aorrtc",)  # crashes its process


class Effort(NamedTuple):
    """What a search may spend: iterations (it counts them itself), a seed, and whether to stop now."""

    iterations: int
    seed: int
    stop: Callable[[], bool]


Search = Callable[[Problem, Effort], Sequence[int] | None]


@dataclass(frozen=True)
class Planner:
    """A planner under its name.

    Attributes
    ----------
    name : str
    search : callable, optional
        A plain search: from `Problem` and `Effort` to the gaits of a way, or None.
    make : callable, optional
        In place of `search`: from an `ompl.control.SpaceInformation` to an `ompl.base.Planner`.
    solver : callable, optional
        Of ours that certify and mend what they find, and can tell that there is no way.
    apart : bool
        Whether it runs in a process of its own, which it may take down.
    """

    name: str
    search: Search | None = None
    make: MakePlanner | None = None
    solver: Callable[..., LatticeSolver] | None = None
    apart: bool = False

    def find(self, problem: Problem, effort: Effort) -> tuple[int, ...] | None:
        """Return the gaits of a way to the goal, or None; they are not certified yet."""
        if self.make is not None:
            return run_planner(problem, self.make, effort.iterations, effort.seed)
        assert self.search is not None  # one of the two is there
        gaits = self.search(problem, effort)
        return None if gaits is None else _checked(self.name, gaits, problem.motion.size)

    def as_ompl(self, cycles: CycleSetup, effort: Effort) -> Any:
        """Return the planner as an `ompl.base.Planner` on a set-up; it also stops when OMPL says so."""
        if self.make is not None:
            planner = self.make(cycles.information)
            planner.setName(self.name)
            return planner

        def find(stop: Callable[[], bool]) -> tuple[int, ...] | None:
            return self.find(cycles.problem, effort._replace(stop=lambda: stop() or effort.stop()))

        return as_ompl_planner(cycles, self.name, find)


def _checked(name: str, gaits: Sequence[int], count: int) -> tuple[int, ...]:
    """Refuse what is no sequence of gaits."""
    try:
        found = tuple(int(gait) for gait in gaits)
    except (TypeError, ValueError):
        found = (-1,)
    if not found or not all(0 <= gait < count for gait in found):
        raise InputError(f"planner '{name}': expected indices of gaits, 0 to {count - 1}, or None")
    return found


def _ours(solver: Callable[..., LatticeSolver], problem: Problem, effort: Effort) -> Sequence[int] | None:
    plan = solver(problem, stop=effort.stop).run().plan
    return None if plan is None else plan.gaits


def _fine(problem: Problem, **options: Any) -> LatticeSolver:
    """Return the lattice search with finer cells near walls: slower, for gaps that the first one misses."""
    settings = replace(
        LATTICE, most_halvings=MENDING.fine_halvings, by_heading=True, slack=MENDING.least_slack
    )
    return LatticeSolver(problem, settings, beams=(), **options)


_known: dict[str, Planner] = {
    name: Planner(name, partial(_ours, solver), solver=solver)
    for name, solver in (("lattice", LatticeSolver), ("runs", RunSolver), ("fine", _fine))
}


def register_planner(name: str, search: Search | None = None, *, ompl: MakePlanner | None = None) -> Planner:
    """Make a planner of one's own known under a name.

    Parameters
    ----------
    name : str
        Lower-case letters, digits, hyphens.
    search : callable, optional
        From `Problem` and `Effort` to the gaits of a way (indices into the gait table), or None.
    ompl : callable, optional
        In place of it: from an `ompl.control.SpaceInformation` to an `ompl.base.Planner` of one's own.

    Raises
    ------
    InputError
        If the name is taken or not allowed, or not exactly one of the two is given.
    """
    if not re.fullmatch(r"[a-z][a-z0-9-]*", name) or name == "auto":
        raise InputError(f"planner '{name}': expected a name of lower-case letters, digits and hyphens")
    if name in _known:
        raise InputError(f"planner '{name}': this name is taken")
    if (search is None) == (ompl is None):
        raise InputError(f"planner '{name}': expected either a search or ompl=…")
    _known[name] = Planner(name, search, ompl, apart=ompl is not None)
    return _known[name]


def planner_named(name: str) -> Planner:
    """Return the planner of a name: ours, a plugin's, or any of OMPL's.

    OMPL's control planners have their own names (rrt, est, kpiece1); its geometric ones, which find the route
    that the gaits follow, theirs after "dubins-" (forward only) or "rs-" (Reeds-Shepp).

    Raises
    ------
    InputError
        If there is none, or if it needs OMPL and OMPL is not installed.
    """
    name = name.lower()
    if name in _known:
        return _known[name]
    kind, hyphen, method = name.rpartition("-")
    method = ALIASES.get(method, method)
    classes = ompl_classes("geometric" if hyphen else "control")
    if method not in classes or method in UNUSABLE or (hyphen and kind not in CURVES):
        raise InputError(f"--planner {name}: expected auto (plan only), {', '.join(_known)}, {_ompl_names()}")
    made = classes[method]
    if kind:
        return Planner(name, partial(_route, kind, made.__name__), apart=True)
    return Planner(name, make=made, apart=True)


def _route(kind: str, method: str, problem: Problem, effort: Effort) -> Sequence[int] | None:
    way = search_geometric(problem, kind, method, effort.iterations, effort.seed)
    return None if way is None else [step.gait for step in way]


def _ompl_names() -> str:
    """Return what OMPL offers, in words."""
    routes = [name for name in ompl_classes("geometric") if name not in UNUSABLE]
    return f"{', '.join(ompl_classes('control'))}, or dubins- or rs- and one of {', '.join(routes)}"

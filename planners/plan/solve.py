"""From a problem to a certified plan: beam, then best-first search, mended where the certificate refuses."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from planners.plan.answer import Plan, PlanResult, Status
from planners.plan.certify import Certificate, Certifier
from planners.plan.explain import narrower_than_any_gait, no_body_fits
from planners.plan.settings import MENDING
from planners.search.beam import BEAM, BeamSearch, BeamSettings
from planners.search.lattice import LATTICE, LatticeSearch, LatticeSettings
from planners.search.problem import ROUNDING_M, Problem
from planners.search.runs import RUNS, RunSearch, RunSettings
from planners.search.tree import Root, at_rest

TOO_NARROW = "no way with these gaits: even the widest route is too narrow for every gait of the table"
# what keeps hitting the posts of a narrow passage needs states told apart by millimetres
FINE_BEAM = BeamSettings(width=40, cell=0.0424, course_rad=0.05, slack=0.000847)
BEAMS = (BEAM, FINE_BEAM)


class LatticeSolver:
    """Search and certificate, together; can be asked to go on.

    A beam looks first: it is quick and its plans are fast, but it may miss the way. Where it does, a finer
    one looks, then the best-first search looks at everything within reach. Where the finer simulation of
    the certificate leads too near to a wall (the search integrates more coarsely), the search begins again
    a few cycles before, from the finer simulation's state. When nothing is left to look at, the cells are
    halved once before the maze is said to have no way.

    Parameters
    ----------
    problem : Problem
    settings : LatticeSettings, optional
        Of the best-first search.
    root : Root, optional
        Where to begin; at rest at the start without it.
    beams : tuple of BeamSettings
        Tried one after the other before the best-first search.
    time_limit_s : float
        A guard only: what is found does not depend on it.
    stop : callable
        Another guard: says when to stop.
    tell : callable
        Gets messages about the progress.
    hand_over : bool
        Answer once when the first beam has failed, so that another search may look before the finer beam and
        the best-first search, which take long where there is little room.
    """

    name = "lattice"

    def __init__(
        self,
        problem: Problem,
        settings: LatticeSettings | None = None,
        root: Root | None = None,
        *,
        beams: tuple[BeamSettings, ...] = BEAMS,
        time_limit_s: float = 30.0,
        stop: Callable[[], bool] = lambda: False,
        tell: Callable[[str], None] = lambda message: None,
        hand_over: bool = False,
    ) -> None:
        self.problem, self.stop, self.tell = problem, stop, tell
        self.hand_over = hand_over
        self.settings, self.beams = settings or LATTICE, beams
        if problem.goal.heading is not None:  # a map of places alone would lead past it
            self.settings = replace(self.settings, by_heading=True)
            self.beams = tuple(replace(beam, by_heading=True) for beam in beams)
        self.began, self.time_limit_s = time.perf_counter(), time_limit_s
        self.whole_way = root is None  # widths are judged on it only
        self.judged = not self.whole_way
        self.begin = root or at_rest(problem)
        self.certifier = Certifier(problem, self.begin)
        self.counts = {"expanded": 0, "simulated": 0, "certificates": 0}
        self.kept: tuple[int, ...] = ()
        self.attempts, self.refined = 0, False
        self.ended = False  # nothing is left to look at
        self.more_slack = 0.0
        self.search = self._search_from(self.begin)

    @property
    def looked_at(self) -> int:
        """Cycles simulated so far, by all searches."""
        return self.counts["simulated"] + self.search.simulated

    def run(self, max_nodes: int = 400_000) -> PlanResult:
        """Return the first certified plan among `max_nodes` more cycles, or why there is none."""
        last = self.looked_at + max_nodes
        while self.attempts < MENDING.attempts:
            outcome = self._look(last)
            if isinstance(outcome, PlanResult):
                return outcome
            if outcome is None:
                beams = len(self.beams)
                if not self._retreat():
                    self.ended = True
                    if self.whole_way and no_body_fits(self.problem):
                        return self._answer("infeasible", TOO_NARROW)
                    return self._answer("not_found", self._exhausted())
                if self.hand_over and len(self.beams) < beams:
                    self.hand_over = False
                    return self._answer("not_found", "no plan in the first beam")
                continue
            gaits = self.kept + outcome
            certificate = self.certifier.certify(gaits)
            self.counts["certificates"] += 1
            if certificate.passed:
                return self._answer("solved", None, Plan(self.name, gaits, certificate))
            self._mend(gaits, certificate)
        return self._answer("not_found", "plans were found but none passed the certificate")

    def _look(self, last: int) -> tuple[int, ...] | PlanResult | None:
        """Return the gaits of a way, None when nothing is left to look at, or the answer when to stop."""
        while not self.search.exhausted:
            if self._too_narrow():
                self.ended = True
                return self._answer("infeasible" if no_body_fits(self.problem) else "not_found", TOO_NARROW)
            way = self.search.advance(MENDING.chunk)
            if way is not None:
                return tuple(step.gait for step in way)
            if self.stop() or time.perf_counter() - self.began > self.time_limit_s:
                return self._answer("timeout", f"no plan within the time limit of {self.time_limit_s:g} s")
            if self.looked_at > last:
                return self._answer("not_found", f"no plan among the first {self.looked_at} cycles looked at")
        return None

    def _exhausted(self) -> str:
        """Say at what resolution nothing was found."""
        s, length = self._resolution, self.problem.robot.length_m
        return (
            f"nothing found at this resolution: states within {1e3 * s.cell * length:.0f} mm, "
            f"{math.degrees(s.course_rad):.0f} deg and {s.speed * length:.2f} m/s of each other were taken "
            "for one, so a way that only one of them has may have slipped through"
        )

    @property
    def _resolution(self) -> LatticeSettings | RunSettings:
        return self.settings

    def _too_narrow(self) -> bool:
        """Judge the widths, once, when the search does not come on."""
        if self.judged or self.looked_at < MENDING.width_nodes or not self.search.in_doubt:
            return False
        self.judged = True
        return narrower_than_any_gait(self.problem)

    def _retreat(self) -> bool:
        """Begin again from the start, more thoroughly; return whether there is anything left to try."""
        if not self.kept:
            if self.beams:
                self.beams = self.beams[1:]
                self.tell(
                    "no plan in this beam; searching " + ("a finer one" if self.beams else "exhaustively")
                )
            elif self.refined:
                return False
            else:
                self.refined = True
                s = self.settings
                self.settings = replace(
                    s,
                    cell=s.cell / 2,
                    course_rad=s.course_rad / 2,
                    speed=s.speed / 2,
                    slack=MENDING.least_slack,
                    by_heading=True,
                )
                self.tell("search exhausted at this resolution; searching again at half of it")
        self._begin_again((), self.begin)
        return True

    def _mend(self, gaits: tuple[int, ...], certificate: Certificate) -> None:
        """Begin again some cycles before the failure, with a little more clearance."""
        self.tell(f"certificate failed: {certificate.reason}; repairing the plan from there")
        assert certificate.failed_cycle is not None  # it has failed
        keep = max(0, certificate.failed_cycle - MENDING.back * self.counts["certificates"])
        here = self.begin
        if keep:
            here = Root(certificate.states[keep - 1], gaits[keep - 1], -ROUNDING_M)
        self.more_slack += MENDING.more_slack
        self._begin_again(gaits[:keep], here)

    def _begin_again(self, kept: tuple[int, ...], here: Root) -> None:
        self.attempts += 1
        self.counts["expanded"] += self.search.expanded
        self.counts["simulated"] += self.search.simulated
        self.kept = kept
        self.search = self._search_from(here)

    def _search_from(self, here: Root) -> BeamSearch | LatticeSearch | RunSearch:
        """Return a new search, with the slack that certificates have asked for."""
        if self.beams:
            beam = self.beams[0]
            return BeamSearch(self.problem, replace(beam, slack=beam.slack + self.more_slack), here)
        settings = replace(self.settings, slack=self.settings.slack + self.more_slack)
        return LatticeSearch(self.problem, settings, here)

    def _answer(self, status: Status, reason: str | None, plan: Plan | None = None) -> PlanResult:
        effort = dict(self.counts)
        effort["expanded"] += self.search.expanded
        effort["simulated"] += self.search.simulated
        return PlanResult(status, plan, reason, time.perf_counter() - self.began, effort)


class RunSolver(LatticeSolver):
    """The same with the search over runs of one gait (`planners.search.runs`): for ways with little room.

    Parameters
    ----------
    problem : Problem
    options
        As `LatticeSolver` has them, from `time_limit_s` on.
    """

    name = "runs"

    def __init__(self, problem: Problem, **options: Any) -> None:
        super().__init__(problem, beams=(), **options)
        self.refined = True  # there is one resolution only
        self.judged = True  # a body on its own track passes where the band that a gait sweeps does not

    @property
    def _resolution(self) -> LatticeSettings | RunSettings:
        return RUNS

    def _search_from(self, here: Root) -> RunSearch:
        return RunSearch(self.problem, replace(RUNS, slack=RUNS.slack + self.more_slack), here)


def solve_with_lattice(
    problem: Problem,
    settings: LatticeSettings | None = None,
    root: Root | None = None,
    *,
    time_limit_s: float = 30.0,
    max_nodes: int = 400_000,
    tell: Callable[[str], None] = lambda message: None,
) -> PlanResult:
    """Return the first certified plan of the searches; see `LatticeSolver`."""
    return LatticeSolver(problem, settings, root, time_limit_s=time_limit_s, tell=tell).run(max_nodes)

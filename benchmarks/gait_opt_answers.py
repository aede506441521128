"""What gait optimization finds against the best that is known, where landscapes are rugged or valves free."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from benchmarks.section import Section
from srs_opt.gait import published_wave
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.free import search_free
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.population import evolved
from srs_opt.gait_opt.search import search
from srs_opt.orbit.steady import Orbit, steady_gait
from srs_opt.robot import Robot, wpi_srs

ROBOT = wpi_srs()
QUICK_ROBOT = ROBOT.with_values(tau1_s=0.3 * ROBOT.tau1_s, tau2_s=0.3 * ROBOT.tau2_s)
COLUMNS = ["", "best known", "found", "certified", "processor s"]
_FEW = 300  # gaits of the quick round's population


@dataclass(frozen=True)
class Case:
    """One question: what is asked, of whom, the best answer known, and how to read one off an orbit."""

    name: str
    robot: Robot
    goal: Goal
    known: str
    read: Callable[[Orbit], str]
    intervals: int = 1

    @property
    def problem(self) -> CycleProblem:
        return CycleProblem((self.robot,), "complex", self.goal, Limits(), self.intervals)


def _speed(orbit: Orbit) -> str:
    return f"{orbit.speed_m_s:.4f} m/s"


def _radius(orbit: Orbit) -> str:
    return f"{abs(orbit.radius_m or float('inf')):.4f} m"


CASES = (
    Case("fastest", ROBOT, Goal(), "0.5574 m/s", _speed),
    Case("fastest, time constants x 0.3", QUICK_ROBOT, Goal(), "0.322 m/s", _speed),
    Case("tightest turn at 0.02 m/s", ROBOT, Goal("turn"), "0.0171 m", _radius),
    Case("pivot", ROBOT, Goal("pivot"), "-", lambda o: f"{o.turn_rate_rad_s:.3f} rad/s"),
    Case("at most two on-intervals", ROBOT, Goal(), "0.63 m/s", _speed, 2),
    Case("at most three on-intervals", ROBOT, Goal(), "-", _speed, 3),
)


def run(quick: bool) -> Section:
    rows = [_few()] if quick else [_answered(case) for case in CASES]
    notes = [
        "Built-in robot, 1-2 Hz, 41-55 kPa, four starts. Best known: CMA-ES over all unknowns of a wave, "
        "many restarts, from another program.",
    ]
    return Section("Gait optimization: answers", COLUMNS, rows, notes)


def _answered(case: Case) -> list[str]:
    begun = time.process_time()
    found = search(case.problem) if case.intervals == 1 else search_free(case.problem).found
    spent = time.process_time() - begun
    passed = "yes" if found.certificate.passed else "no"
    return [case.name, case.known, case.read(found.orbits[0]), passed, f"{spent:.0f}"]


def _few() -> list[str]:
    case = CASES[1]
    begun = time.process_time()
    gait, _ = evolved(case.problem, published_wave(case.robot, 1.5, 48.0).gait(), 3, _FEW)
    found = case.read(steady_gait(case.robot, gait))
    return [f"{case.name}, {_FEW} gaits", case.known, found, "-", f"{time.process_time() - begun:.1f}"]

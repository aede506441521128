"""What half and double of every tuned value do to answers and to processor time.

    python -m benchmarks.half_and_double [--minutes 60] [--jobs 1]

The tuned values stand in frozen `Settings`. A probe is a small task of one part of the program; which values
it reads is recorded, and each value is tried with the cheapest probe that reads it, at half and at double.
Nothing is tuned by these rows: they say which values matter, and to what.
"""

from __future__ import annotations

import math
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.section import Section
from benchmarks.stored import Row, gather, stored_rows, study_parser
from benchmarks.tuned import Tuned, changed, reads, times, tuned_values

NAME = "half_and_double"
FACTORS = (0.5, 2.0)
PATIENCE = 8.0  # times a probe's own time, after which a changed one is ended
SEEN = 0.01  # relative change of an answer that is told
DEARER = 2.0  # times the processor time that is told: other work on the machine alone makes it up to 1.8
Answers = dict[str, float | str]


def integrations() -> Answers:
    """Simulate six gaits from rest; how far the end is from that of a far finer integration."""
    from srs_opt.gait import Wave
    from srs_opt.orbit.body import integrator
    from srs_opt.robot import wpi_srs
    from srs_opt.simulate.timeline import Timeline

    run, worst, steps = integrator(wpi_srs()), 0.0, 0
    for frequency in (1.0, 1.5, 2.0):
        for offset in (0.0, 0.5):
            timeline = Timeline.of_gait(Wave.uniform(4, frequency, 55.0, 1.2, offset).gait(), 4.0)
            found = run.integrate(timeline, run.rest())
            exact = run.integrate(timeline, run.rest(), 1e-8)
            worst = max(worst, float(np.hypot(*(found.pose[-1] - exact.pose[-1])[:2])))
            steps += found.time_s.size
    return {"error after 4 s (mm)": 1e3 * worst, "steps": steps}


def orbits() -> Answers:
    """Find the steady motion of twelve gaits, rigid and soft."""
    from srs_opt.errors import NoAnswerError
    from srs_opt.gait import Wave
    from srs_opt.orbit.steady import steady_gait
    from srs_opt.robot import wpi_srs

    rng, found = np.random.default_rng(3), []
    soft = wpi_srs().with_values(bending_stiffness_n_m2=0.01)
    for robot in (*[wpi_srs()] * 9, *[soft] * 3):
        phases = np.cumsum(rng.uniform(0.6, 1.8, 4))
        wave = Wave(rng.uniform(1, 2), 55.0, tuple(phases), tuple(rng.uniform(-0.6, 0.6, 4)))
        try:
            found.append(steady_gait(robot, wave.gait()))
        except NoAnswerError:
            continue
    speeds = [abs(s.speed_m_s) for s in found]
    return {"found": len(found), "sum of speeds (m/s)": float(sum(speeds))}


def optimum() -> Answers:
    """Optimize a gait for speed from two starts, with its certificate."""
    from srs_opt.gait_opt.collocation.problem import CycleProblem
    from srs_opt.gait_opt.goal import Goal, Limits
    from srs_opt.gait_opt.search import search
    from srs_opt.robot import wpi_srs

    found = search(CycleProblem((wpi_srs(),), "complex", Goal("speed"), Limits()), 2)
    return {"speed (m/s)": found.certificate.speed_m_s}


def manoeuvre() -> Answers:
    """Plan a standing start."""
    from srs_opt.manoeuvre.search import find
    from srs_opt.manoeuvre.task import End, Start, Task
    from srs_opt.orbit.body import integrator
    from srs_opt.robot import wpi_srs

    run = integrator(wpi_srs())
    found = find(run, Task(Start.at_rest(run), End(past_m=0.3)), [], 2, 1, 2)
    return {"time (s)": found.plan.duration_s}


def calibration() -> Answers:
    """Calibrate a robot from six short trials."""
    from srs_opt.calibrate.run import calibrate

    found = calibrate(_dataset("null"))
    return {"misfit": found.after, "friction along": found.robot.friction_tangential}


def verdict() -> Answers:
    """Search what is missing where a tether drags, in six short trials."""
    from srs_opt.discrepancy.pipeline import diagnose

    found = diagnose(_dataset("typical"))
    answers: Answers = {"verdict": found.verdict.word}
    answers["named"] = found.selection.best.label if found.selection else ""
    return answers | ({"left of the gap": found.gap.with_effect / found.gap.calibrated} if found.gap else {})


def plans() -> Answers:
    """Plan through three narrow mazes of 16 x 16 cells."""
    from benchmarks.planner_mazes import LIMIT_S, MARGIN_M, NODES, contest_maze, setting
    from planners.plan.solve import solve_with_lattice
    from planners.search.problem import Problem

    robot, gaits, motion, size = setting()
    answers: Answers = {}
    for seed in (3, 6, 7):
        problem = Problem(robot, gaits, motion, contest_maze(seed, 0.18, size), MARGIN_M)
        found = solve_with_lattice(problem, time_limit_s=LIMIT_S, max_nodes=NODES)
        answers[f"maze {seed} (s)"] = found.plan.duration_s if found.plan else found.status
    return answers


def drives() -> Answers:
    """Drive a plan with a robot that slips more than the planned one."""
    from benchmarks.planner_mazes import LIMIT_S, MARGIN_M, NODES, contest_maze, setting
    from planners.drive.execute import execute
    from planners.plan.solve import solve_with_lattice
    from planners.search.problem import Problem

    robot, gaits, motion, size = setting()
    problem = Problem(robot, gaits, motion, contest_maze(1, 0.27, size), MARGIN_M)
    plan = solve_with_lattice(problem, time_limit_s=LIMIT_S, max_nodes=NODES).plan
    if plan is None:
        return {"arrived": "no plan"}
    true = robot.with_values(friction_normal=0.9 * robot.friction_normal)
    driven = execute(problem, plan, true)
    return {
        "arrived": str(driven.reached),
        "time (s)": driven.duration_s,
        "clearance (mm)": 1e3 * driven.smallest_clearance_m,
    }


def refined_plan() -> Answers:
    """Refine a plan's switch times."""
    from benchmarks.planner_mazes import LIMIT_S, MARGIN_M, NODES, setting
    from benchmarks.planner_traverse import maze_named
    from planners.plan.solve import solve_with_lattice
    from planners.refine.refine import refine
    from planners.search.problem import Problem

    robot, gaits, motion, size = setting()
    problem = Problem(robot, gaits, motion, maze_named("door 72", size), MARGIN_M)
    plan = solve_with_lattice(problem, time_limit_s=LIMIT_S, max_nodes=NODES).plan
    assert plan is not None
    made = refine(problem, plan).plan
    return {"time (s)": made.duration_s, "clearance (mm)": 1e3 * made.certificate.clearance_m}


def second_opinion() -> Answers:
    """Judge a gait by another physics engine."""
    from benchmarks.judge import random_gait
    from srs_opt.judge.opinion import opinion_on
    from srs_opt.robot import wpi_srs

    opinion = opinion_on(wpi_srs(), "random", random_gait(1))
    return {"agrees": str(opinion.agrees), "speed (m/s)": opinion.judge.speed_m_s}


PROBES: dict[str, Callable[[], Answers]] = {
    probe.__name__: probe
    for probe in (integrations, orbits, optimum, manoeuvre, calibration, verdict, plans, drives,
                  refined_plan, second_opinion)
}  # fmt: skip


@lru_cache(maxsize=2)
def _dataset(kind: str) -> Any:
    """Return a small data set of the virtual laboratory."""
    from benchmarks.discrepancy import generate
    from srs_opt.measurement.dataset import load_dataset

    with tempfile.TemporaryDirectory() as scratch:
        hidden = ("tether_drag",) if kind == "typical" else ()
        generate(Path(scratch) / "set", kind, hidden, 17, "second", brief=True)
        return load_dataset(Path(scratch) / "set")


@lru_cache(maxsize=len(PROBES))
def as_it_is(probe: str) -> tuple[Answers, float, frozenset[Tuned]]:
    """Return a probe's answers with the values in force, its processor time, and the values that it reads."""
    PROBES[probe]()  # libraries load, equations compile
    with reads(tuned_values()) as seen:
        PROBES[probe]()
    begun = time.process_time()
    answers = PROBES[probe]()
    return answers, time.process_time() - begun, frozenset(seen)


def items() -> list[tuple[str, str, str, float, str]]:
    """Return every tuned value, factor and the cheapest probe that reads it."""
    costs = {probe: as_it_is(probe)[1] for probe in PROBES}
    found = []
    for tuned in tuned_values():
        probes = [p for p in sorted(PROBES, key=costs.__getitem__) if tuned in as_it_is(p)[2]]
        at_home = [p for p in probes if _own(p, tuned)]
        for factor in FACTORS if probes else ():
            if times(tuned.value, factor) != tuned.value:
                found.append((tuned.module, tuned.instance, tuned.field, factor, (at_home or probes)[0]))
    return found


def _own(probe: str, tuned: Tuned) -> bool:
    """Return whether a probe is of the part of the program that a value belongs to."""
    homes = {
        "integrations": "srs_opt.simulate", "orbits": "srs_opt.orbit", "optimum": "srs_opt.gait_opt",
        "manoeuvre": "srs_opt.manoeuvre", "calibration": "srs_opt.calibrate",
        "verdict": "srs_opt.discrepancy", "plans": "planners.", "drives": "planners.drive",
        "refined_plan": "planners.refine", "second_opinion": "srs_opt.judge",
    }  # fmt: skip
    return tuned.module.startswith(homes[probe])


def tried(module: str, instance: str, field: str, factor: float, probe: str) -> Row:
    """Run a probe with one value changed; return its row."""
    tuned = Tuned(module, instance, field)
    before, cost_s, _ = as_it_is(probe)
    value = times(tuned.value, factor)
    row: Row = {"setting": tuned.name, "module": module, "probe": probe, "factor": factor}
    row |= {"value": tuned.value, "tried": value, "answers": before, "cpu_s": cost_s}
    begun = time.process_time()
    try:
        with changed(tuned, value), _at_most(max(PATIENCE * cost_s, 20.0)):
            row["found"] = PROBES[probe]()
    except _TooLong:
        row["failed"] = f"ended after {PATIENCE:g} times as long"
    except Exception as error:  # a value may make no sense at all, which is an answer
        row["failed"] = f"{type(error).__name__}: {str(error).splitlines()[0][:120] if str(error) else ''}"
    return row | {"tried_cpu_s": time.process_time() - begun}


class _TooLong(BaseException):
    """No handler of the program's own may take it for an error."""


@contextmanager
def _at_most(seconds: float) -> Iterator[None]:
    def ring(*_: object) -> None:
        raise _TooLong

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def _effect(row: Row) -> str:
    """Return what a change did, in words; empty where nothing is told."""
    if "failed" in row:
        return str(row["failed"])
    told = []
    for key, old in row["answers"].items():
        new = row["found"].get(key)
        if isinstance(old, str) or isinstance(new, str):
            if new != old:
                told.append(f"{key} {old or 'none'} → {new or 'none'}")
        elif new is None or abs(new - old) > SEEN * abs(old):
            told.append(f"{key} {old:.4g} → {new:.4g}" if new is not None else f"{key} missing")
    ratio = row["tried_cpu_s"] / row["cpu_s"]
    if ratio > DEARER or ratio < 1 / DEARER:
        told.append(f"processor time x {ratio:.2g}")
    return "; ".join(told)


def section(rows: list[Row], when: str) -> Section:
    """Return a line per value that changes an answer or the time."""
    lines, quiet = [], 0
    by_setting: dict[str, dict[float, Row]] = {}
    for row in rows:
        by_setting.setdefault(row["setting"], {})[row["factor"]] = row
    for name, both in sorted(by_setting.items(), key=lambda entry: (_any(entry[1])["module"], entry[0])):
        effects = {factor: _effect(both[factor]) if factor in both else "not run" for factor in FACTORS}
        if set(effects.values()) <= {"", "not run"}:
            quiet += 1
            continue
        row = _any(both)
        lines.append([name, _short(row["value"]), row["probe"], *(effects[f] or "same" for f in FACTORS)])
    note = (
        f"Each value at half and double, by the cheapest task that reads it; an answer is told from "
        f"{100 * SEEN:g} % of change on, processor time from x {DEARER:g}. {len(by_setting)} values tried, "
        f"{quiet} of them without such a change. Measured {when}."
    )
    return Section("Tuned values: half and double", ("value", "is", "task", "half", "double"), lines, [note])


def _any(both: dict[float, Row]) -> Row:
    return next(iter(both.values()))


def _short(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return ", ".join(map(_short, value))
    return f"{value:.4g}" if math.isfinite(value) else str(value)


def run(quick: bool) -> Section:
    """Return the stored rows; quickly, what the cheapest probe says."""
    if quick:
        return section([tried(*item) for item in items_of("integrations")[:2]], "quickly")
    stored = stored_rows(NAME)
    if stored is None:
        return Section("Tuned values: half and double", ("value",), [], ["Not made yet."])
    return section(stored[1], stored[0])


def items_of(probe: str) -> list[tuple[str, str, str, float, str]]:
    """Return what one probe reads, with both factors."""
    read = sorted(as_it_is(probe)[2], key=lambda t: t.name)
    return [(t.module, t.instance, t.field, f, probe) for t in read if _own(probe, t) for f in FACTORS]


def main(argv: list[str] | None = None) -> int:
    """Run the study."""
    parser = study_parser(NAME, __doc__, 0)
    parser.add_argument("--probe", nargs="+", choices=list(PROBES), help="only these tasks (default: all)")
    options = parser.parse_args(argv)
    chosen = items() if not options.probe else [i for p in options.probe for i in items_of(p)]
    rows = gather(NAME, tried, chosen, options)
    print(section(rows, "now").markdown())
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Gait tables built by continuation: generation by generation, each gait from a neighbour's optimum."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait, published_wave
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.continuation import Continuation, Stage, continuation_stages, run_stages
from srs_opt.gait_opt.corrections import end_for_end, in_step
from srs_opt.gait_opt.driver import driver_gaits
from srs_opt.gait_opt.entries import certified_table
from srs_opt.gait_opt.finish import quantized
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.score import score
from srs_opt.gait_opt.settings import GOAL
from srs_opt.gait_opt.starts import best_start, plain_waves
from srs_opt.gait_opt.table import GaitTable, TableGait
from srs_opt.gait_opt.table_settings import TABLE
from srs_opt.gait_opt.table_spec import TableSpec, generations, table_specs
from srs_opt.orbit.steady import Orbit, steady_gait
from srs_opt.parallel import executor
from srs_opt.parallel.sweep import Resume, sweep
from srs_opt.robot import Robot


@dataclass(frozen=True)
class Work:
    """What all optimizations of a table have in common."""

    robot: Robot
    model: str
    limits: Limits


@dataclass(frozen=True)
class Task:
    """One optimization: the spec and the gait to start from."""

    spec: TableSpec
    start: Gait


def build_table(
    robot: Robot,
    model: str = "complex",
    limits: Limits | None = None,
    say: Callable[[str], None] = lambda text: None,
    *,
    jobs: int = 2,
    cluster: str | None = None,
    resume: Path | None = None,
    driver: bool = False,
    quick: bool = False,
) -> GaitTable:
    """Return the table of `robot`: optimized left turns and straights, their images, all certified.

    With `driver`, slow gaits and pivots follow, of which planners make no use. A `quick` table holds four of
    the optimized gaits with their images.

    Wishes out of reach are left out, and said so. With the folder `resume`, gaits found there are not
    optimized again; it is left for the caller to remove.

    Raises
    ------
    NoAnswerError
        If no spec is within reach.
    """
    work = Work(robot, model, limits or Limits(pressure_kpa=TABLE.pressure_kpa))
    kept = None if resume is None else Resume(resume, f"gait table {work}")
    frequency, pressure = work.limits.frequency_hz[1], work.limits.pressure_kpa[1]
    starts: dict[str | None, Gait] = {None: published_wave(robot, frequency, pressure).gait()}
    entries: dict[str, list[TableGait]] = {}
    asked = table_specs(robot, quick=quick)
    for group in generations(asked):
        tasks = [Task(spec, starts[spec.after]) for spec in group]
        with executor(jobs, cluster) as where:
            results = sweep(partial(_fulfilled, work), tasks, chunk=1, where=where, resume=kept)
            for task, result in zip(tasks, results):
                say(result["line"])
                entries[task.spec.name] = [TableGait.of_record(g) for g in result["gaits"]]
                gait = result["next"]
                starts[task.spec.name] = task.start if gait is None else Gait.of_record(gait)
    gaits = tuple(entry for spec in asked for entry in entries[spec.name])
    if not gaits:
        raise NoAnswerError(f"no gait of the table is within reach of robot '{robot.name}'")
    table = GaitTable(robot.name, robot.fingerprint(), model, gaits)
    if driver:
        table = with_driver_gaits(robot, table, work.limits, say, jobs=jobs)
    table = certified_table(robot, table, work.limits, say, jobs=jobs, cluster=cluster)
    say(f"{len(table.gaits)} gaits from {len(asked)} optimizations, all certified")
    return table


def with_driver_gaits(
    robot: Robot, table: GaitTable, limits: Limits, say: Callable[[str], None], *, jobs: int = 1
) -> GaitTable:
    """Return the table with slow gaits and pivots at its end, not yet certified."""

    def imaged(name: str, gait: Gait) -> list[TableGait]:
        return images(robot, table.model, name, gait, limits.tick_s)

    slow = driver_gaits(robot, table.model, limits, imaged, say, jobs=jobs)
    return table.with_gaits(table.for_planning().gaits + slow)


def _fulfilled(work: Work, tasks: Sequence[Task]) -> list[dict[str, Any]]:
    """Optimize each task; return records of the gait with its images, the gait to go on from, a line."""
    return [_fulfil(work, task) for task in tasks]


def _fulfil(work: Work, task: Task) -> dict[str, Any]:
    spec = task.spec
    objective = "speed" if spec.radius_m is None else "turn"
    goal = Goal(objective, radius_m=spec.radius_m, envelope_m=spec.band_m)
    problem = CycleProblem((spec.laden(work.robot),), work.model, goal, work.limits)
    try:
        found = _solve(problem, task)
        gait = quantized(problem, found.gait)
        gaits = images(work.robot, work.model, spec.name, gait, work.limits.tick_s)
    except NoAnswerError as error:
        return {"gaits": [], "next": None, "line": f"{spec.name}: left out, {error}"}
    entry = gaits[0]
    radius = "straight" if entry.radius_m is None else f"radius {entry.radius_m:.3f} m"
    line = f"{spec.name}: {entry.speed_m_s:.3f} m/s, {radius}, band {sum(entry.envelope_m):.4f} m"
    if not _kept(spec, entry):
        return {"gaits": [], "next": None, "line": f"{line}: left out, not what was asked for"}
    return {"gaits": [g.record() for g in gaits], "next": found.gait.record(), "line": line}


def _kept(spec: TableSpec, entry: TableGait) -> bool:
    """Whether a gait is what was wished for, near enough."""
    if entry.speed_m_s < GOAL.least_speed_m_s:
        return False
    if spec.load:  # asked for under load: without, it is what it is
        return (spec.radius_m is None) == (abs(entry.turn_rate_rad_s) < GOAL.straight_rad_s)
    if spec.band_m is not None and sum(entry.envelope_m) > spec.band_m * (1 + TABLE.band_excess):
        return False
    if spec.radius_m is None:
        return entry.radius_m is None or abs(entry.turn_rate_rad_s) < GOAL.straight_rad_s
    return entry.radius_m is not None and abs(entry.radius_m / spec.radius_m - 1) < TABLE.radius_error


def _solve(problem: CycleProblem, task: Task) -> Continuation:
    """Return the best continuation from the neighbour's gait and plain waves.

    A band makes starts hard to compare before they are optimized: then the best of either kind is.
    """
    neighbour, waves = [task.start], plain_waves(problem)
    band = task.spec.band_m
    kinds = [neighbour + waves] if band is None else [neighbour, waves]
    found = [_continued(problem, best_start(problem, gaits), task.spec) for gaits in kinds]
    return max(found, key=lambda c: c.score.total)


def _continued(problem: CycleProblem, start: Gait, spec: TableSpec) -> Continuation:
    own = problem.robots[0].friction_speed_m_s
    if spec.after is None:
        return run_stages(problem, start, continuation_stages(own))
    stages = tuple(Stage(max(own, v), n, reach, most) for v, n, reach, most in TABLE.stages)
    found = run_stages(problem, start, stages)
    band = spec.band_m
    if band is not None and (excess := sum(found.orbits[0].envelope_m) - band) > TABLE.band_excess * band:
        # the mesh sees the body's reach at some instants only: ask for less by as much as it missed
        less = replace(problem, goal=replace(problem.goal, envelope_m=band - excess))
        again = run_stages(less, found.gait, stages[-1:])
        found = replace(again, score=score(problem, again.gait, again.orbits))
    return found


def images(robot: Robot, model: str, name: str, gait: Gait, tick_s: float) -> list[TableGait]:
    """Return the gait and its images: turning right, and both backwards; straight ones only backwards.

    All are in step with each other, so that changing from one to another disturbs the motion least.
    """

    def orbit(image: Gait) -> Orbit:
        return steady_gait(robot, in_step(image, tick_s), model)

    forward, backward = orbit(gait), orbit(end_for_end(gait))
    straight = abs(forward.turn_rate_rad_s) < GOAL.straight_rad_s
    made: list[tuple[str, Orbit]] = [(name if straight else f"{name} left", forward)]
    if not straight:
        made.append((f"{name} right", orbit(gait.mirrored())))
    made.append((f"{name} back" if straight else f"{name} back {_side(backward)}", backward))
    if not straight:
        other = orbit(end_for_end(gait.mirrored()))
        made.append((f"{name} back {_side(other)}", other))
    return [TableGait.of_orbit(n, o) for n, o in made]


def _side(orbit: Orbit) -> str:
    """Return the side on which the centre of rotation lies."""
    return "left" if orbit.radius_m is not None and orbit.radius_m > 0 else "right"

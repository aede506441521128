"""The gaits of a table: what is asked for, in an order in which each starts from a neighbour."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait, published_wave
from srs_opt.gait_opt.aim import aimed, end_for_end, in_step
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.finish import finished
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.ladder import Climb, Rung, climb, ladder
from srs_opt.gait_opt.starts import turn_miss
from srs_opt.gait_opt.table import GaitTable, TableGait
from srs_opt.orbit.steady import Orbit, steady_gait
from srs_opt.processes import workers_deaf_to_interrupts
from srs_opt.robot import Robot

RADII_OVER_LENGTH = (4.0, 2.5, 1.6, 1.2, 0.9, 0.7, 0.55, 0.45)
BANDS_OVER_WIDTH = (1.95, 1.75, 1.6)  # total width of the swept band over the body's
TABLE_PRESSURE_KPA = (24.0, 55.0)
_BAND_EXCESS = 1.01
_RADIUS_ERROR = 0.03
_STRAIGHT_RAD_S = 0.02
_LEAST_SPEED_M_S = 0.02


@dataclass(frozen=True)
class Wish:
    """One entry to optimize: a radius (None: straight) and a band limit (None: free); `name` says so."""

    name: str
    radius_m: float | None
    band_m: float | None


def wishes(robot: Robot) -> tuple[Wish, ...]:
    """Return what a table holds, forward and to the left; the other three quadrants are images."""
    spine = robot.segments * robot.pitch_m
    radii = [round(r * spine, 3) for r in RADII_OVER_LENGTH]
    bands = [round(b * robot.body_width_m, 3) for b in BANDS_OVER_WIDTH]
    found = [Wish("fast", None, None), *(Wish(f"fast R{r:g}", r, None) for r in radii)]
    for k, band in enumerate(bands):
        found.append(Wish(f"slim{band * 1e3:.0f}", None, band))
        found += [Wish(f"slim{band * 1e3:.0f} R{r:g}", r, band) for r in radii[: 5 - k]]
    return tuple(found)


def chains(robot: Robot) -> tuple[tuple[Wish, ...], ...]:
    """Return the wishes as chains (one per band) in which each gait starts from its predecessor."""
    by_band: dict[float | None, list[Wish]] = {}
    for wish in wishes(robot):
        by_band.setdefault(wish.band_m, []).append(wish)
    return tuple(tuple(chain) for chain in by_band.values())


@dataclass(frozen=True)
class Work:
    """What one process needs to optimize a chain."""

    robot: Robot
    model: str
    limits: Limits
    start: Gait


def build_table(
    robot: Robot,
    model: str = "complex",
    limits: Limits | None = None,
    say: Callable[[str], None] = lambda text: None,
    jobs: int = 2,
) -> GaitTable:
    """Return the table of `robot`: optimized left turns and straights, their images, all re-simulated.

    Wishes out of reach are left out, and said so.
    """
    limits = limits or Limits(pressure_kpa=TABLE_PRESSURE_KPA)
    total = len(wishes(robot))
    fastest = _fastest(robot, model, limits, say)
    work = Work(robot, model, limits, fastest)
    entries: list[TableGait] = []
    for found, lines in _all_chains(work, chains(robot), jobs):
        entries += found
        for line in lines:
            say(line)
    if not entries:
        raise NoAnswerError(f"no gait of the table is within reach of robot '{robot.name}'")
    say(f"{len(entries)} gaits from {total} optimizations")
    return GaitTable(robot.name, robot.fingerprint(), model, tuple(entries))


def _all_chains(
    work: Work, all_chains: tuple[tuple[Wish, ...], ...], jobs: int
) -> Iterator[tuple[list[TableGait], list[str]]]:
    if jobs == 1:
        yield from (_chain(work, chain) for chain in all_chains)
        return
    from joblib import Parallel, delayed

    pool = Parallel(n_jobs=jobs, return_as="generator")
    with workers_deaf_to_interrupts():
        chains = pool(delayed(_chain)(work, chain) for chain in all_chains)
    yield from chains


def _fastest(robot: Robot, model: str, limits: Limits, say: Callable[[str], None]) -> Gait:
    problem = CycleProblem((robot,), model, Goal("speed"), limits)
    start = published_wave(robot, limits.frequency_hz[1], limits.pressure_kpa[1]).gait()
    found = climb(problem, start, ladder(robot.friction_speed_m_s))
    say(f"fastest straight gait: {found.orbits[0].speed_m_s:.3f} m/s")
    return found.gait


def _chain(work: Work, chain: tuple[Wish, ...]) -> tuple[list[TableGait], list[str]]:
    """Optimize the wishes of one chain one after the other; return the gaits and a line on each."""
    entries: list[TableGait] = []
    lines = []
    start = work.start
    for wish in chain:
        objective = "speed" if wish.radius_m is None else "turn"
        goal = Goal(objective, radius_m=wish.radius_m, envelope_m=wish.band_m)
        problem = CycleProblem((work.robot,), work.model, goal, work.limits)
        try:
            found = _solve(problem, start)
            gait = finished(problem, found.gait)
            new = images(work.robot, work.model, wish.name, gait, work.limits.tick_s)
        except NoAnswerError as error:
            lines.append(f"{wish.name}: left out, {error}")
            continue
        entry = new[0]
        radius = "straight" if entry.radius_m is None else f"radius {entry.radius_m:.3f} m"
        line = f"{wish.name}: {entry.speed_m_s:.3f} m/s, {radius}, band {sum(entry.envelope_m):.4f} m"
        if _kept(wish, entry):
            entries += new
            start = found.gait
        else:
            line += ": left out, not what was asked for"
        lines.append(line)
    return entries, lines


def _kept(wish: Wish, entry: TableGait) -> bool:
    """Whether a gait is what was wished for, near enough."""
    if entry.speed_m_s < _LEAST_SPEED_M_S:
        return False
    if wish.band_m is not None and sum(entry.envelope_m) > wish.band_m * _BAND_EXCESS:
        return False
    if wish.radius_m is None:
        return entry.radius_m is None or abs(entry.turn_rate_rad_s) < _STRAIGHT_RAD_S
    return entry.radius_m is not None and abs(entry.radius_m / wish.radius_m - 1) < _RADIUS_ERROR


def _solve(problem: CycleProblem, start: Gait) -> Climb:
    own = problem.robots[0].friction_speed_m_s
    if problem.goal.radius_m is not None:
        start = aimed(start, turn_miss(problem), 0.02)
    rungs = (Rung(max(own, 0.004), 60, 0.06, 3), Rung(own, 70, 0.03, 2))
    return climb(problem, start, rungs)


def images(robot: Robot, model: str, name: str, gait: Gait, tick_s: float) -> list[TableGait]:
    """Return the gait and its images: turning right, and both backwards; straight ones only backwards.

    All are in step with each other, so that changing from one to another disturbs the motion least.
    """

    def orbit(image: Gait) -> Orbit:
        return steady_gait(robot, in_step(image, tick_s), model)

    forward, backward = orbit(gait), orbit(end_for_end(gait))
    straight = abs(forward.turn_rate_rad_s) < _STRAIGHT_RAD_S
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

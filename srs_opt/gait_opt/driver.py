"""Slow gaits and pivots for a driver: waves evolved by simulation until they move as wanted.

The planner does not use them: it needs the fastest gaits for every radius and band. A person who drives
by speed and turn rate needs what lies between these and standing still. There nothing is optimal, so there is
nothing to collocate: any certified gait near the wanted motion will do, the slimmer the better.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait, Wave
from srs_opt.gait_opt.goal import STRAIGHT_RAD_S, Limits
from srs_opt.gait_opt.table import LEVER_M, NEAR_M_S, TableGait
from srs_opt.orbit.steady import Orbit, steady_gaits
from srs_opt.robot import Robot

# m/s and rad/s, forward and to the left; the images are the rest. Steps are such that what lies between two
# wishes is no farther than `NEAR_M_S` from one of them.
SLOW_M_S = (0.02, 0.05, 0.1, 0.15)
TURNS = ((0.05, 0.5), *((v, w) for v in (0.1, 0.2) for w in (0.5, 1.0, 1.5, 2.0)), (0.35, 0.5))
PIVOTS_RAD_S = (0.3, 0.6, 1.0, 1.5)
MISS_M_S = NEAR_M_S / 2  # an entry that misses by more is left out
POOL, PARENTS, CHILDREN, GENERATIONS = 600, 8, 32, 14
NEAR_ENOUGH_M_S, LEAST_GENERATIONS = 0.004, 5  # then breeding ends
SPREAD, DECADES = 0.3, 1.5  # of mutations: largest, as a share of a parameter's range; over how many decades
BAND_WEIGHT = 0.05  # m/s per metre of band: a slimmer gait is better, the motion counts first


@dataclass(frozen=True)
class Motion:
    """What a driver may want: speed (m/s, + forward) and turn rate (rad/s, + left)."""

    speed_m_s: float
    turn_rate_rad_s: float

    @property
    def name(self) -> str:
        """The entry's name, without its side."""
        if not self.speed_m_s:
            return f"pivot {self.turn_rate_rad_s:g}"
        turn = f" turn {self.turn_rate_rad_s:g}" if self.turn_rate_rad_s else ""
        return f"slow {self.speed_m_s:g}{turn}"


WANTED = (
    *(Motion(v, 0.0) for v in SLOW_M_S),
    *(Motion(v, w) for v, w in TURNS),
    *(Motion(0.0, w) for w in PIVOTS_RAD_S),
)


def driver_gaits(
    robot: Robot,
    model: str,
    limits: Limits,
    images: Callable[[str, Gait], list[TableGait]],
    say: Callable[[str], None] = lambda text: None,
    *,
    wanted: Sequence[Motion] = WANTED,
    jobs: int = 1,
    seed: int = 0,
) -> tuple[TableGait, ...]:
    """Return gaits for the wanted motions, with their images; none of them is certified yet.

    Parameters
    ----------
    images : callable
        (name, gait) -> the entry and its mirror images and reverses.
    """
    breed = _Breed(robot, model, limits, jobs)
    random = np.random.default_rng(seed)
    pool = breed.simulated(random.uniform(size=(POOL, 2 * robot.segments + 2)))
    found: list[TableGait] = []
    for motion in wanted:
        pool = breed.bred(pool, motion, random)  # what was bred for one motion may serve the next
        if not pool.orbits:
            say("no wave has a steady state: no slow gaits, no pivots")
            break
        best = min(pool.orbits, key=lambda orbit: _price(orbit, motion))
        gait, miss = best.gait, _miss(best, motion)
        if miss > MISS_M_S:
            say(f"{motion.name}: left out, the nearest gait misses by {miss:.3f} m/s")
            continue
        try:
            entries = images(motion.name, gait)
        except NoAnswerError as error:
            say(f"{motion.name}: left out, {error}")
            continue
        if not motion.speed_m_s:  # backwards it is the same pivot
            entries = [e for e in entries if " back" not in e.name]
        found += [replace(entry, planned=False) for entry in entries]
    return tuple(found)


@dataclass(frozen=True)
class _Bred:
    """Simulated waves: genes (n, genes) in [0, 1] with their orbits."""

    genes: np.ndarray
    orbits: tuple[Orbit, ...]


@dataclass(frozen=True)
class _Breed:
    robot: Robot
    model: str
    limits: Limits
    jobs: int

    def simulated(self, genes: np.ndarray) -> _Bred:
        """Return the waves of these genes that have a steady state."""
        gaits = [self._gait(g) for g in genes]
        known = [(g, gait) for g, gait in zip(genes, gaits) if gait is not None]
        orbits = steady_gaits(self.robot, [gait for _, gait in known], self.model, jobs=self.jobs)
        kept = [(g, o) for (g, _), o in zip(known, orbits) if not isinstance(o, NoAnswerError)]
        kept = [(g, o) for g, o in kept if o.largest_multiplier < 1]
        return _Bred(np.array([g for g, _ in kept]), tuple(o for _, o in kept))

    def bred(self, pool: _Bred, wanted: Motion, random: np.random.Generator) -> _Bred:
        """Return the pool and what was bred from it towards the wanted motion."""
        straight = wanted.turn_rate_rad_s == 0
        for generation in range(GENERATIONS):
            if not pool.orbits:
                break
            price = np.array([_price(orbit, wanted) for orbit in pool.orbits])
            if (
                generation >= LEAST_GENERATIONS
                and _miss(pool.orbits[price.argmin()], wanted) < NEAR_ENOUGH_M_S
            ):
                break
            parents = pool.genes[np.argsort(price)[:PARENTS]]
            children = np.repeat(parents, -(-CHILDREN // len(parents)), axis=0)
            spread = SPREAD * 10 ** (-DECADES * random.uniform(size=(len(children), 1)))
            moved = random.uniform(size=children.shape) < random.uniform(0.2, 1.0, (len(children), 1))
            children = children + spread * moved * random.standard_normal(children.shape)
            if straight:
                children[:, 2 + self.robot.segments :] = 0.5
            born = self.simulated(np.clip(children, 0.0, 1.0))
            if born.orbits:
                pool = _Bred(np.concatenate([pool.genes, born.genes]), pool.orbits + born.orbits)
        return pool

    def _gait(self, genes: np.ndarray) -> Gait | None:
        """Return the wave: frequency, pressure, phases, offsets; None where its dwell is too short."""
        n = self.robot.segments
        (slow, fast), (weak, strong) = self.limits.frequency_hz, self.limits.pressure_kpa
        frequency, pressure = slow + genes[0] * (fast - slow), weak + genes[1] * (strong - weak)
        phase = 2 * np.pi * np.cumsum(genes[2 : 2 + n])
        offset = 0.95 * (2 * genes[2 + n :] - 1)
        wave = Wave(float(frequency), float(pressure), tuple(phase), tuple(offset)).gait()
        gait = wave.on_ticks(self.limits.tick_s)
        return gait if gait.shortest_dwell_s() >= self.limits.min_dwell_s - 1e-9 else None


def _miss(orbit: Orbit, wanted: Motion) -> float:
    off = orbit.turn_rate_rad_s - wanted.turn_rate_rad_s
    return math.hypot(orbit.speed_m_s - wanted.speed_m_s, LEVER_M * off)


def _price(orbit: Orbit, wanted: Motion) -> float:
    if wanted.turn_rate_rad_s == 0 and abs(orbit.turn_rate_rad_s) > STRAIGHT_RAD_S:
        return _miss(orbit, wanted) + 2 * MISS_M_S  # nearly straight is not straight
    return _miss(orbit, wanted) + BAND_WEIGHT * sum(orbit.envelope_m)

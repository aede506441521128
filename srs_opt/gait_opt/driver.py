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
from srs_opt.gait_opt.goal import Limits
from srs_opt.gait_opt.settings import GOAL
from srs_opt.gait_opt.table import TableGait
from srs_opt.gait_opt.table_settings import DRIVER_GAIT, TABLE
from srs_opt.orbit.steady import Orbit, steady_gaits
from srs_opt.robot import Robot


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


def wanted_motions() -> tuple[Motion, ...]:
    """Return what a table for drivers is to hold, forward and to the left; the images are the rest."""
    return (
        *(Motion(v, 0.0) for v in DRIVER_GAIT.slow_m_s),
        *(Motion(v, w) for v, w in DRIVER_GAIT.turns),
        *(Motion(0.0, w) for w in DRIVER_GAIT.pivots_rad_s),
    )


def driver_gaits(
    robot: Robot,
    model: str,
    limits: Limits,
    images: Callable[[str, Gait], list[TableGait]],
    say: Callable[[str], None] = lambda text: None,
    *,
    wanted: Sequence[Motion] | None = None,
    jobs: int = 1,
    seed: int = 0,
) -> tuple[TableGait, ...]:
    """Return gaits for the wanted motions, with their images; none of them is certified yet.

    Parameters
    ----------
    wanted : sequence of Motion, optional
        Without, `wanted_motions`.
    images : callable
        (name, gait) -> the entry and its mirror images and reverses.
    """
    evolution = _Evolution(robot, model, limits, jobs)
    random = np.random.default_rng(seed)
    pool = evolution.simulated(random.uniform(size=(DRIVER_GAIT.first_waves, 2 * robot.segments + 2)))
    found: list[TableGait] = []
    for motion in wanted_motions() if wanted is None else wanted:
        pool = evolution.extended(pool, motion, random)  # waves found for one motion may serve the next
        if not pool.orbits:
            say("no wave has a steady state: no slow gaits, no pivots")
            break
        best = min(pool.orbits, key=lambda orbit: _price(orbit, motion))
        gait, miss = best.gait, _miss(best, motion)
        if miss > TABLE.near_m_s / 2:
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
class _Waves:
    """Simulated waves: parameters (n, 2 + 2 segments) in [0, 1] with their orbits."""

    genes: np.ndarray
    orbits: tuple[Orbit, ...]


@dataclass(frozen=True)
class _Evolution:
    robot: Robot
    model: str
    limits: Limits
    jobs: int

    def simulated(self, genes: np.ndarray) -> _Waves:
        """Return the waves of these genes that have a steady state."""
        gaits = [self._gait(g) for g in genes]
        known = [(g, gait) for g, gait in zip(genes, gaits) if gait is not None]
        orbits = steady_gaits(self.robot, [gait for _, gait in known], self.model, jobs=self.jobs)
        kept = [(g, o) for (g, _), o in zip(known, orbits) if not isinstance(o, NoAnswerError)]
        kept = [(g, o) for g, o in kept if o.largest_multiplier < 1]
        return _Waves(np.array([g for g, _ in kept]), tuple(o for _, o in kept))

    def extended(self, pool: _Waves, wanted: Motion, random: np.random.Generator) -> _Waves:
        """Return the pool with the offspring of a (mu + lambda) evolution towards the wanted motion."""
        straight = wanted.turn_rate_rad_s == 0
        for generation in range(DRIVER_GAIT.generations):
            if not pool.orbits:
                break
            price = np.array([_price(orbit, wanted) for orbit in pool.orbits])
            if (
                generation >= DRIVER_GAIT.least_generations
                and _miss(pool.orbits[price.argmin()], wanted) < DRIVER_GAIT.near_enough_m_s
            ):
                break
            parents = pool.genes[np.argsort(price)[: DRIVER_GAIT.parents]]
            children = np.repeat(parents, -(-DRIVER_GAIT.children // len(parents)), axis=0)
            spread = DRIVER_GAIT.mutation * 10 ** (
                -DRIVER_GAIT.mutation_decades * random.uniform(size=(len(children), 1))
            )
            moved = random.uniform(size=children.shape) < random.uniform(0.2, 1.0, (len(children), 1))
            children = children + spread * moved * random.standard_normal(children.shape)
            if straight:
                # the middle of the range is an offset of zero: no duty bias, no turn
                children[:, 2 + self.robot.segments :] = 0.5
            offspring = self.simulated(np.clip(children, 0.0, 1.0))
            if offspring.orbits:
                pool = _Waves(np.concatenate([pool.genes, offspring.genes]), pool.orbits + offspring.orbits)
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
    return math.hypot(orbit.speed_m_s - wanted.speed_m_s, TABLE.lever_m * off)


def _price(orbit: Orbit, wanted: Motion) -> float:
    if wanted.turn_rate_rad_s == 0 and abs(orbit.turn_rate_rad_s) > GOAL.straight_rad_s:
        return _miss(orbit, wanted) + TABLE.near_m_s  # nearly straight is not straight
    return _miss(orbit, wanted) + DRIVER_GAIT.wider_m_s_per_m * sum(orbit.envelope_m)

"""Waves that change on the way, evolved by simulation (CMA-ES): starts that no steady wave leads to.

A standing start wants a frequency that rises with the speed, from about 1 to 3.5 Hz, and lags that fall: from
a steady wave that is a move of every switch by up to a cycle, which no local step makes. So a wave of the
paper's (13) gets a frequency that is linear between knots, and a lag and an offset that go evenly from one
value to another; a population of such waves is judged by simulation alone. Single switches are left to the
local optimization after it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from srs_opt.gait_opt.evolution import evolution
from srs_opt.manoeuvre.settings import WAVE_POPULATION, WAVE_START
from srs_opt.manoeuvre.shooting import shoot
from srs_opt.manoeuvre.solve import Candidate, Solver
from srs_opt.manoeuvre.starts import arrived, passed, random_pressure_kpa, with_end
from srs_opt.manoeuvre.task import Task
from srs_opt.manoeuvre.valves import ValvePlan, ValveRow


@dataclass(frozen=True)
class Family:
    """Waves that change on the way, as vectors of genes.

    The genes: frequency at the knots (Hz), phase at time 0, lag at begin and end (rad), offset at begin and
    end, pressure (kPa), and the logarithm of the time for which the wave is played over `played_s`.
    """

    task: Task
    segments: int
    played_s: float

    @property
    def size(self) -> int:
        """Number of genes."""
        return WAVE_POPULATION.knots + 7

    @property
    def spread(self) -> np.ndarray:
        """Standard deviations of a population's first generation."""
        # CMA-ES takes no spread of zero: 1e-6 of it freezes a gene
        free = 1.0 if self.task.pressure_is_free else 1e-6
        timed = 1e-6 if passed(self.task) else 1.0
        rest = [
            WAVE_POPULATION.spread_phase,
            *[WAVE_POPULATION.spread_lag] * 2,
            *[WAVE_POPULATION.spread_offset] * 2,
            free * WAVE_POPULATION.spread_kpa,
            timed * WAVE_POPULATION.spread_log_time,
        ]
        return np.array([WAVE_POPULATION.spread_hz] * WAVE_POPULATION.knots + rest)

    def steady(self, rng: np.random.Generator) -> np.ndarray:
        """Return the genes of a random steady wave."""
        frequency, lag = (
            rng.uniform(*WAVE_START.frequency_hz),
            rng.choice((-1, 1)) * rng.uniform(*WAVE_START.lag_rad),
        )
        offset = rng.uniform(-0.95, 0.95) * rng.integers(2)
        pressure = random_pressure_kpa(self.task, rng)
        time = 0.0 if passed(self.task) else math.log(rng.uniform(0.3, 1.2))
        phase = rng.uniform(0, 2 * math.pi)
        return np.array(
            [*[frequency] * WAVE_POPULATION.knots, phase, lag, lag, offset, offset, pressure, time]
        )

    def plan(self, genes: np.ndarray) -> ValvePlan:
        """Return what the valves do, playable, with what the task's end asks for."""
        phase, lag, later_lag, offset, later_offset, pressure, time = genes[WAVE_POPULATION.knots :]
        # bounded: a gene that runs away must not make a motion of hours
        played = self.played_s * math.exp(min(time, 1.0))
        at = np.linspace(0.0, played, WAVE_POPULATION.instants)
        share = at / played
        frequency = np.interp(
            share, np.linspace(0, 1, WAVE_POPULATION.knots), genes[: WAVE_POPULATION.knots]
        ).clip(*WAVE_POPULATION.limits_hz)
        # the phase is the integral of the frequency, as omega t in (13)
        cycles = np.concatenate([[0.0], np.cumsum((frequency[1:] + frequency[:-1]) / 2 * np.diff(at))])
        lags, offsets = lag + (later_lag - lag) * share, offset + (later_offset - offset) * share
        rows = []
        for segment in range(self.segments):
            wave = np.sin(phase + 2 * math.pi * cycles + segment * lags) + offsets
            sign = np.where(wave >= 0, 1, -1)
            k = np.flatnonzero(sign[1:] != sign[:-1])
            # a switch is where the wave passes zero, to second order in the instants' distance
            crossed = at[k] + (at[k + 1] - at[k]) * wave[k] / (wave[k] - wave[k + 1])
            states = (int(sign[0]), *(int(s) for s in sign[k + 1]))
            rows.append(ValveRow(states, tuple(float(t) for t in crossed)))
        low, high = self.task.bounds.pressure_kpa
        kpa = self.task.pressure_kpa or float(np.clip(pressure, low, high))
        return with_end(self.task, ValvePlan(tuple(rows), played, kpa))


def evolved(solver: Solver, begun: Candidate, seed: int) -> Candidate:
    """Return the best of a population of waves that change on the way.

    Parameters
    ----------
    begun : Candidate
        The best steady wave; its duration says how much time the task takes.
    """
    task = solver.task
    played = begun.plan.duration_s * (WAVE_POPULATION.longer if passed(task) else 1.0)
    family = Family(task, solver.run.structure.segments, min(played, task.longest_s or math.inf))
    rng = np.random.default_rng(seed)
    first = [family.steady(rng) for _ in range(WAVE_POPULATION.first_generations * WAVE_POPULATION.size)]
    judged = _judged(solver, family, first)
    middle = first[min(range(len(first)), key=lambda k: judged[k].merit)]
    best = min(judged, key=lambda c: c.merit)
    generations = evolution(
        partial(_judged, solver, family),
        lambda candidates: [c.merit for c in candidates],
        middle,
        family.spread,
        seed=seed + 1,
        popsize=WAVE_POPULATION.size,
        maxiter=WAVE_POPULATION.generations,
    )
    for candidates, _ in generations:
        best = min([best, *candidates], key=lambda c: c.merit)
    return best


def _judged(solver: Solver, family: Family, genes: list[np.ndarray]) -> list[Candidate]:
    """Simulate waves; those whose end is a line or a heading are broken off there."""
    shots = shoot(solver.run, solver.task.start.state, [family.plan(g) for g in genes], solver.step_s)
    found = []
    for shot in shots:
        node = arrived(solver.task, shot) if passed(solver.task) else None
        if node is not None:
            plan = replace(shot.plan, duration_s=float(shot.time_s[node])).trimmed()
            shot = replace(shot, plan=plan, time_s=shot.time_s[: node + 1], states=shot.states[: node + 1])
        found.append(solver.judged(shot))
    return found

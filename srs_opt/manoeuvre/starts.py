"""Where the optimization begins: many simulated waves and table gaits, the most promising of them kept.

A wave here is one of the paper's (13) with its own frequency, pressure, lag, offset and phase at time 0. None
is steady: what counts is how each does from the manoeuvre's own start to its end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from srs_opt.gait import Gait, Wave
from srs_opt.manoeuvre.settings import REGULATOR, WAVE_START
from srs_opt.manoeuvre.shooting import Shot, shoot
from srs_opt.manoeuvre.solve import Candidate, Solver
from srs_opt.manoeuvre.task import Task
from srs_opt.manoeuvre.valves import COINCIDENT_S, ValvePlan, ValveRow, gait_end
from srs_opt.model.state import HEADING, X
from srs_opt.orbit.steady import Orbit


def starts(solver: Solver, gaits: Sequence[Gait], count: int, seed: int) -> list[Candidate]:
    """Return the best `count` starts among waves (mirrored and backwards too) and the given gaits."""
    task, segments = solver.task, solver.run.structure.segments
    waves = WAVE_START.waves * count
    rng = np.random.default_rng(seed)
    low, high = task.bounds.pressure_kpa
    given = task.pressure_kpa
    drawn: list[Gait] = [g if given is None else replace(g, pressure_kpa=given) for g in gaits]
    drawn = [g for g in drawn if given is not None or low <= g.pressure_kpa <= high]
    if not passed(task):
        waves = min(waves, WAVE_START.plans // WAVE_START.lengths // 2)
        drawn = [drawn[k] for k in rng.permutation(len(drawn))[:waves]]
    turning = task.end.turn_rad is not None or task.end.pose is not None
    backwards = task.end.past_m is not None and task.end.past_m < 0
    for _ in range(waves):
        frequency, lag = rng.uniform(*WAVE_START.frequency_hz), rng.uniform(*WAVE_START.lag_rad)
        phase = rng.uniform(0, 2 * math.pi)
        pressure = task.pressure_kpa or random_pressure_kpa(task, rng)
        offset = (
            0.0 if not turning else rng.uniform(0.0, 0.95) * np.sign(task.end.turn_rad or rng.uniform(-1, 1))
        )
        wave = Wave(
            frequency,
            pressure,
            tuple(phase + (-lag if backwards else lag) * i for i in range(1, segments + 1)),
            (float(offset),) * segments,
        )
        drawn.append(wave.gait())
    plans = _until_arrival(solver, drawn) or [plan for gait in drawn for plan in lengths(task, gait)]
    judged = sorted(solver.judge(plans), key=lambda c: c.merit)
    kept: list[Candidate] = []
    for candidate in judged:
        if len(kept) == count:
            break
        # starts of like merit are taken for one, so that the solver's time goes to different ones
        if all(abs(candidate.merit - k.merit) > WAVE_START.same_merit * abs(k.merit) for k in kept):
            kept.append(candidate)
    return kept


def random_pressure_kpa(task: Task, rng: np.random.Generator) -> float:
    """Return a pressure for a wave, most often near the highest: what bends more is mostly faster."""
    low, high = task.bounds.pressure_kpa
    return float(high - (high - low) * WAVE_START.pressure_span * rng.uniform() ** 2)


def passed(task: Task) -> bool:
    """Whether the end is a line or a heading that only has to be passed."""
    end = task.end
    return not end.rest and end.orbit is None and end.pose is None


def _until_arrival(solver: Solver, gaits: Sequence[Gait]) -> list[ValvePlan]:
    """Return the gaits that arrive, played until they do, where the end is a line or a heading."""
    task = solver.task
    if not passed(task):
        return []
    plans = []
    longest = [playable(task, lengths(task, g)[-1]) for g in gaits]
    for shot in shoot(solver.run, task.start.state, longest, solver.step_s):
        node = arrived(task, shot)
        if node is not None:
            plans.append(replace(shot.plan, duration_s=float(shot.time_s[node])).trimmed())
    return plans


def arrived(task: Task, shot: Shot) -> int | None:
    """Return the first node at which the line or the heading is passed, None if it never is."""
    done = shot.time_s >= WAVE_START.least_s
    turned = shot.states[:, HEADING] - task.start.state[HEADING]
    for wanted, have in ((task.end.past_m, shot.states[:, X]), (task.end.turn_rad, turned)):
        if wanted is not None:
            done &= np.sign(wanted) * have >= abs(wanted)
    return int(done.argmax()) if done.any() else None


def lengths(task: Task, gait: Gait) -> list[ValvePlan]:
    """Return the gait played for several lengths of time, with what the task's start and end ask for."""
    longest = task.longest_s or _likely_s(task)
    # in equal ratios: a tenth of a second matters for a short time only
    times = np.geomspace(max(longest / 6, WAVE_START.least_s), longest, WAVE_START.lengths)
    return [with_end(task, ValvePlan.of_gaits((gait,), float(played))) for played in times]


def with_end(task: Task, plan: ValvePlan) -> ValvePlan:
    """Return the plan, playable, with the venting or the gait that the task's end asks for."""
    if task.end.rest:
        plan = vented(plan, WAVE_START.vent_s)
    if task.end.orbit is not None:
        plan = followed(plan, task.end.orbit.gait, 2)
    return playable(task, plan)


def _likely_s(task: Task) -> float:
    """Return a time within which the task is done with some ease."""
    end = task.end
    way = abs(end.past_m or 0.0) + (math.hypot(*end.pose[:2]) if end.pose else 0.0)
    turn = abs(end.turn_rad or 0.0) + (abs(end.pose[2]) if end.pose else 0.0)
    return 1.0 + 3.0 * way + 1.5 * turn + WAVE_START.settlings * _settling_s(end.orbit)


def _settling_s(orbit: Orbit | None) -> float:
    """Return the time in which a disturbance of a gait decays to 1/e."""
    if orbit is None or not 0 < orbit.largest_multiplier < 1:
        return 0.0
    return -orbit.gait.period_s / math.log(orbit.largest_multiplier)


def vented(plan: ValvePlan, for_s: float) -> ValvePlan:
    """Return the plan with all valves vented at its end, for so long more."""
    rows = tuple(ValveRow((*r.states, 0), (*r.times_s, plan.duration_s)) for r in plan.rows)
    return replace(plan, rows=rows, duration_s=plan.duration_s + for_s)


def followed(plan: ValvePlan, gait: Gait, cycles: int) -> ValvePlan:
    """Return the plan and whole cycles of a gait after it, at the gait's pressure."""
    later = ValvePlan.of_gaits((gait,), cycles * gait.period_s)
    rows = []
    for row, more in zip(plan.rows, later.rows):
        times = tuple(t + plan.duration_s for t in more.times_s)
        if row.states[-1] == more.states[0]:
            rows.append(ValveRow(row.states + more.states[1:], row.times_s + times))
        else:
            rows.append(ValveRow(row.states + more.states, (*row.times_s, plan.duration_s, *times)))
    return ValvePlan(tuple(rows), plan.duration_s + later.duration_s, gait.pressure_kpa)


def playable(task: Task, plan: ValvePlan) -> ValvePlan:
    """Return the plan begun from the start's valves, every switch late enough for the dwell."""
    dwell = task.bounds.dwell_s
    begun = None if task.start.gait is None else gait_end(task.start.gait)
    rows = []
    for segment, row in enumerate(plan.rows):
        states, times = list(row.states), list(row.times_s)
        earliest = 0.0
        if begun is not None:
            state, age = begun[0][segment], begun[1][segment]
            if states[0] != state:
                states, times = [state, *states], [0.0, *times]
            earliest = max(dwell - age, 0.0)
        elif times:
            earliest = dwell
        kept_states, kept_times = [states[0]], []
        for state, time in zip(states[1:], times):
            at = max(time, earliest)
            if state == kept_states[-1]:
                continue
            if at > time + dwell:  # so late that the pulse is left out
                kept_states[-1:] = [state] if len(kept_states) > 1 else kept_states[-1:]
                continue
            kept_states.append(state)
            kept_times.append(at)
            earliest = at + dwell
        rows.append(ValveRow(tuple(kept_states), tuple(kept_times)))
    end = max([plan.duration_s, *(r.times_s[-1] + COINCIDENT_S for r in rows if r.times_s)])
    return replace(plan, rows=tuple(rows), duration_s=end, early=ramp(task, plan.pressure_kpa))


def ramp(task: Task, to_kpa: float) -> tuple[tuple[float, float], ...]:
    """Return the regulator's way from the pressure of the gait before, in stairs."""
    if task.start.gait is None or task.start.gait.pressure_kpa == to_kpa:
        return ()
    stairs = REGULATOR.stairs
    middles = (np.arange(stairs) + 0.5) / stairs
    kpa = task.start.gait.pressure_kpa + middles * (to_kpa - task.start.gait.pressure_kpa)
    return tuple((REGULATOR.settle_s * (k + 1) / stairs, float(value)) for k, value in enumerate(kpa))

"""Small exact corrections of a gait: hit a wanted turn, stand on the controller's ticks, swap ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.gait_opt.goal import Limits
from srs_opt.gait_opt.settings import DUTY_BIAS


def duty_biased(gait: Gait, cycles: float) -> Gait:
    """Return the gait with every on-interval longer by `cycles` of the period (it turns further left)."""
    period = gait.period_s
    change = cycles * period / 2
    lengths = [(off - on) % period for pairs in gait.intervals for on, off in pairs]
    shortest, longest = min(lengths) / period, max(lengths) / period
    gaps = [
        (on - off) % period
        for pairs in gait.intervals
        for (_, off), (on, _) in zip(pairs, (*pairs[1:], pairs[0]))
    ]
    room = min(gaps) / period - cycles  # several intervals of a segment must not meet
    if shortest + cycles < DUTY_BIAS.least_share or longest + cycles > 1 - DUTY_BIAS.least_share or room <= 0:
        raise NoAnswerError("the duty bias is too large: valves would hardly switch")
    pairs = tuple(
        tuple(((on - change) % period, (off + change) % period) for on, off in pairs)
        for pairs in gait.intervals
    )
    return replace(gait, intervals=pairs)


def steered(gait: Gait, miss: Callable[[Gait], float], tolerance: float, most: float | None = None) -> Gait:
    """Return the gait duty-biased so that ``miss(gait)``, which grows with turning left, is zero.

    `most` bounds the bias, in cycles (by default `DUTY_BIAS.largest_bias`). The nearest miss is returned
    where zero is out of reach, the gait itself where it has no steady state.
    """
    most = DUTY_BIAS.largest_bias if most is None else most
    tried: dict[float, float] = {}

    def at(bias: float) -> float:
        if bias not in tried:
            try:
                tried[bias] = miss(duty_biased(gait, bias))
            except NoAnswerError:
                tried[bias] = np.nan
        return tried[bias]

    if np.isnan(at(0.0)) or abs(at(0.0)) <= tolerance:  # without a steady state there is nothing to steer by
        return gait
    direction = -np.sign(at(0.0))
    below, step = 0.0, DUTY_BIAS.first_step
    while abs(below) < most:
        above = below + direction * step
        value = at(above)
        if np.isnan(value):
            break
        if value * at(below) <= 0:
            return duty_biased(gait, _bisected(at, below, above, tolerance))
        below, step = above, DUTY_BIAS.step_growth * step
    known = {k: abs(v) for k, v in tried.items() if not np.isnan(v)}
    best = min(known, key=known.__getitem__)
    return duty_biased(gait, best) if best else gait


def _bisected(at: Callable[[float], float], a: float, b: float, tolerance: float) -> float:
    """Return a root between a and b (regula falsi with halving, so that the function need not be smooth)."""
    for k in range(DUTY_BIAS.most_bisections):
        fa, fb = at(a), at(b)
        # every third step halves: regula falsi alone creeps where the function is bent
        c = (a + b) / 2 if k % 3 == 2 or fa == fb else a - fa * (b - a) / (fb - fa)
        fc = at(c)
        if np.isnan(fc):
            break
        if abs(fc) <= tolerance:
            return c
        a, b = (a, c) if fa * fc <= 0 else (c, b)
    return min((a, b), key=lambda v: abs(at(v)))


def end_for_end(gait: Gait) -> Gait:
    """Return the gait for the robot turned end for end: what was the head's valve timing is the tail's.

    A chain read from its other end bends the other way. A robot without a difference between head and tail
    then makes exactly the same motion backwards.
    """
    return replace(gait, intervals=tuple(reversed(gait.mirrored().intervals)))


def symmetrized(gait: Gait) -> Gait:
    """Return the gait with every single on-interval made exactly half a cycle long (it runs straight)."""
    period = gait.period_s
    rows = []
    for ((on, off),) in gait.intervals:
        middle = on + ((off - on) % period) / 2
        rows.append((((middle - period / 4) % period, (middle + period / 4) % period),))
    return replace(gait, intervals=tuple(rows))


def within(limits: Limits, gait: Gait) -> Gait:
    """Return the gait played faster or slower, and at another pressure, so that it keeps the limits."""
    frequency = float(np.clip(gait.frequency_hz, *limits.frequency_hz))
    pressure = float(np.clip(gait.pressure_kpa, *limits.pressure_kpa))
    scale = gait.frequency_hz / frequency
    rows = tuple(tuple((on * scale, off * scale) for on, off in pairs) for pairs in gait.intervals)
    return Gait(gait.period_s * scale, pressure, rows)


def on_ticks(gait: Gait, tick_s: float, frequency_hz: tuple[float, float] | None = None) -> Gait:
    """Return the gait on the controller's ticks; half-cycle intervals stay half a cycle.

    The period is rounded to an even number of ticks, inside the frequency limits where they are given.
    """
    # an even number, so that half a cycle is whole ticks and a straight gait stays straight
    even = 2 * tick_s
    count = max(round(gait.period_s / even), 2)
    if frequency_hz is not None:
        least, most = np.ceil(1 / frequency_hz[1] / even - 1e-9), np.floor(1 / frequency_hz[0] / even + 1e-9)
        count = int(np.clip(count, least, max(most, least)))
    ticks = 2 * count
    scale = 1 / gait.period_s * ticks
    rows = []
    for pairs in gait.intervals:
        row = []
        for on, off in pairs:
            length = max(round((off - on) % gait.period_s * scale), 1)
            start = round(on * scale)
            row.append((start % ticks * tick_s, (start + length) % ticks * tick_s))
        rows.append(tuple(row))
    return Gait(ticks * tick_s, round(gait.pressure_kpa, 3), tuple(rows))


def in_step(gait: Gait, tick_s: float) -> Gait:
    """Return the gait with its cycle begun where the body wave has phase zero, on a whole tick.

    Gaits are changed where cycles end. When all of a table's gaits begin at the same phase of the body
    wave, the wave runs on through a change; otherwise the body jerks from one shape into another, and that
    costs a fifth of a second of way each time.
    """
    # rounded to whole ticks: the phase is zero to half a tick
    delay = -gait.wave_phase_rad() / (2 * np.pi) * gait.period_s
    return gait.later(round(delay / tick_s) * tick_s)

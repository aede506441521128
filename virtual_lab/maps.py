"""Speed and radius of gaits, measured from the tracks that the camera sees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from virtual_lab.assemble import NOMINAL, Factors
from virtual_lab.camera import picture
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth

COLUMNS = (
    "frequency_hz", "pressure_kpa", "offset", "phase_lag_rad", "speed_m_s", "speed_sd_m_s",
    "radius_m", "radius_sd_m", "replicates",
)  # fmt: skip
STRAIGHT_M = 10.0  # larger radii are written as straight


@dataclass(frozen=True)
class Motion:
    """Steady motion of a gait; the turn rate is positive to the left."""

    speed_m_s: float
    turn_rate_rad_s: float
    radius_m: float | None


def steady_motion(
    truth: Truth,
    trial: Trial,
    factors: Factors = NOMINAL,
    *,
    settle_s: float = 2.0,
    cycles: int = 3,
    samples: int = 64,
) -> Motion:
    """Return the motion of a gait over whole cycles after it has settled.

    Frames a whole number of cycles apart show the same shape, so the second is a turn and a shift of the
    first: the turn gives the turn rate, its fixed point the centre of rotation.
    """
    period = 1.0 / trial.frequency_hz
    first = math.ceil(settle_s / period) * period
    labels = first + np.arange(samples * (cycles + 1)) * period / samples
    frames = picture(truth, trial, labels, factors)
    gap = samples * cycles
    before, after = frames[:-gap], frames[gap:]
    centre0, centre1 = before.mean(axis=1), after.mean(axis=1)
    a, b = before - centre0[:, None], after - centre1[:, None]
    cross = np.sum(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
    turned = math.atan2(cross, float(np.sum(a * b)))
    # a single cycle settles which multiple of 2 pi the turn over all cycles has
    one = frames[samples:] - frames[samples:].mean(axis=1, keepdims=True)
    zero = frames[:-samples] - frames[:-samples].mean(axis=1, keepdims=True)
    per_cycle = math.atan2(
        float(np.sum(zero[..., 0] * one[..., 1] - zero[..., 1] * one[..., 0])), float(np.sum(zero * one))
    )
    turned += 2 * math.pi * round((cycles * per_cycle - turned) / (2 * math.pi))
    shift = float(np.mean(np.hypot(*(centre1 - centre0).T)))
    rate = turned / (cycles * period)
    if abs(rate) * STRAIGHT_M * cycles * period < shift:
        return Motion(shift / (cycles * period), rate, None)
    turn = np.array([[math.cos(per_cycle), -math.sin(per_cycle)], [math.sin(per_cycle), math.cos(per_cycle)]])
    centres = frames.mean(axis=1)
    fixed = np.linalg.solve(np.eye(2) - turn, (centres[samples:] - centres[:-samples] @ turn.T).T).T
    radius = float(np.mean(np.hypot(*(centres[:-samples] - fixed).T)))
    return Motion(abs(rate) * radius, rate, math.copysign(radius, rate))


def map_rows(
    truth: Truth, trials: Sequence[Trial], factors: Sequence[Sequence[Factors]]
) -> list[tuple[str, ...]]:
    """Return the rows of maps.csv: mean and standard deviation over the replicates of every gait.

    Parameters
    ----------
    truth : Truth
    trials : sequence of Trial
        One per gait.
    factors : sequence of sequences of Factors
        The replicates of each gait.
    """
    rows: list[tuple[str, ...]] = []
    for trial, replicates in zip(trials, factors):
        found = [steady_motion(truth, trial, f) for f in replicates]
        speeds = np.array([m.speed_m_s for m in found])
        radii = np.array([m.radius_m for m in found if m.radius_m is not None])
        rates = np.array([m.turn_rate_rad_s for m in found])
        turning = len(radii) == len(found) and bool(np.all(rates > 0) or np.all(rates < 0))
        spread = 1 if len(found) > 1 else 0
        rows.append(
            (
                f"{trial.frequency_hz:.3f}",
                f"{trial.pressure_kpa:.1f}",
                f"{trial.offset:.2f}",
                f"{trial.phase_lag_rad:.6f}",
                f"{speeds.mean():.5f}",
                f"{speeds.std(ddof=spread):.5f}" if spread else "",
                f"{radii.mean():.5f}" if turning else "",
                f"{radii.std(ddof=spread):.5f}" if turning and spread else "",
                str(len(found)),
            )
        )
    return rows

"""A gait in the engine: played from rest until its cycles repeat, then measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dart_snake.bending import Lags, respond
from dart_snake.engine import Snake
from srs_opt.gait import Gait
from srs_opt.judge.bodies import body_of, drive_of, pull_of
from srs_opt.judge.settings import ENGINE, SETTLING, EngineSettings
from srs_opt.robot import Robot
from srs_opt.simulate.cycle_motion import CycleMotion, cycle_motion

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Judged:
    """A gait's steady motion in the engine.

    Attributes
    ----------
    speed_m_s, turn_rate_rad_s : float
    radius_m : float or None
        None when straight.
    speed_error_m_s, turn_rate_error_rad_s : float or None
        By halving the step and doubling the hinges; None where that was not done.
    cycles : int
        Played until they repeated.
    settled : bool
        Whether they did; if not, the last ones are averaged.
    """

    speed_m_s: float
    turn_rate_rad_s: float
    radius_m: float | None
    speed_error_m_s: float | None
    turn_rate_error_rad_s: float | None
    cycles: int
    settled: bool

    def to_record(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {
            "speed_m_s": self.speed_m_s,
            "turn_rate_rad_s": self.turn_rate_rad_s,
            "radius_m": self.radius_m,
            "error": None
            if self.speed_error_m_s is None
            else {"speed_m_s": self.speed_error_m_s, "turn_rate_rad_s": self.turn_rate_error_rad_s},
            "cycles": self.cycles,
            "settled": self.settled,
        }


def judge_gait(
    robot: Robot, gait: Gait, settings: EngineSettings = ENGINE, *, refine: bool = False
) -> Judged:
    """Return a gait's steady motion in the engine; with `refine`, at half the step, with its error."""
    coarse = _steady(robot, gait, settings)
    if not refine:
        return coarse
    fine = _steady(robot, gait, replace(settings, step_s=settings.step_s / 2))
    hinged = _steady(robot, gait, replace(settings, pairs=2 * settings.pairs))
    speed = abs(fine.speed_m_s - coarse.speed_m_s) + abs(hinged.speed_m_s - coarse.speed_m_s)
    turn = abs(fine.turn_rate_rad_s - coarse.turn_rate_rad_s)
    turn += abs(hinged.turn_rate_rad_s - coarse.turn_rate_rad_s)
    return replace(fine, speed_error_m_s=speed, turn_rate_error_rad_s=turn)


def _steady(robot: Robot, gait: Gait, settings: EngineSettings) -> Judged:
    """Play cycles from rest until they repeat."""
    steps = max(math.ceil(gait.period_s / settings.step_s - 1e-9), 1)
    step_s = gait.period_s / steps
    every = max(steps // SETTLING.samples_per_cycle, 1)
    snake = Snake(body_of(robot), step_s=step_s, pairs=settings.pairs, pull=pull_of(robot, room=False))
    durations, valves = gait.phases()
    shared = np.ones(durations.size)
    drive = drive_of(robot, valves, gait.pressure_kpa * shared, gait.frequency_hz * shared)
    times = np.asarray(np.arange(1, steps + 1) * step_s, dtype=np.float64)
    lags, mass = Lags.rest(robot.segments), np.array([link.mass_kg for link in snake.body.links])
    before = snake.look()
    motions: list[CycleMotion] = []
    settled = False
    while not settled and len(motions) < SETTLING.most_cycles:
        curvature, rate, lags = respond(lags, durations, drive, (robot.tau1_s, robot.tau2_s), times)
        played = snake.play(curvature, rate, every)
        x, y, theta = (
            np.concatenate([getattr(before, key)[-1:], getattr(played, key)])
            for key in ("x_m", "y_m", "theta_rad")
        )
        share = mass / mass.sum()
        pose = np.stack([x @ share, y @ share, theta.mean(axis=1)], axis=1)
        time_s = np.concatenate([[0.0], played.time_s - before.time_s[-1]])
        origin = pose[0, :2]
        pose[:, :2] -= origin
        motions.append(cycle_motion(time_s, pose, (x - origin[0]).T, (y - origin[1]).T, robot.body_width_m))
        before = played
        settled = len(motions) >= SETTLING.least_cycles and _has_settled(motions, robot.length_m)
    last = motions[-1:] if settled else motions[-SETTLING.averaged_cycles :]
    speed = float(np.mean([m.speed_m_s for m in last]))
    turn = float(np.mean([m.turn_rate_rad_s for m in last]))
    radius = last[-1].radius_m if settled or last[-1].radius_m is None else speed / turn
    return Judged(speed, turn, radius, None, None, len(motions), settled)


def _has_settled(motions: Sequence[CycleMotion], length_m: float) -> bool:
    """Whether what the coming cycles can still change is small: changes fall geometrically, so that the sum
    of all that are to come is the last one times ratio / (1 - ratio)."""
    lever_m = SETTLING.lever_body * length_m
    rates = np.array([[m.speed_m_s, m.turn_rate_rad_s * lever_m] for m in motions[-4:]])
    changes = np.hypot(*np.diff(rates, axis=0).T)
    # the slower of the last two ratios, so that one lucky cycle does not end the wait
    ratio = min(
        max(changes[-1] / max(changes[-2], 1e-12), changes[-2] / max(changes[-3], 1e-12)),
        SETTLING.slowest_ratio,
    )
    least_m_s = SETTLING.least_change_body_s * length_m
    left = changes.max() * ratio / (1 - ratio)
    return bool(left < max(SETTLING.remaining_share * math.hypot(*rates[-1]), least_m_s))

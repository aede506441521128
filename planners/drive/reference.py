"""The reference that a drive follows: a plan's poses, speeds and gaits as nodes."""

from __future__ import annotations

import math

import numpy as np

from planners.drive.settings import DEFAULT_DRIVE, DriveSettings
from planners.plan.answer import Plan
from planners.search.problem import Problem
from planners.search.track import Reference
from srs_opt.simulate.interpolate import linear


def reference_of(problem: Problem, plan: Plan, settings: DriveSettings = DEFAULT_DRIVE) -> Reference:
    """Return the plan's nodes; the course is the direction of travel, free of the gait's swing."""
    c = plan.certificate
    periods = problem.motion.periods(plan.gaits)
    ends = np.concatenate([[0.0], np.cumsum(periods)])
    steady = problem.motion.steady_speed_m_s
    played = problem.motion.rows(plan.gaits)
    way = list(played)
    if len(way) > 1 and steady[way[-1]] * steady[way[-2]] < 0:
        way[-1] = way[-2]  # the last gait only brakes: the robot still travels as in the cycle before
    gaits = [problem.motion.rest, *way]
    heading = np.interp(ends, c.time_s, c.pose[:, 2])
    course = heading + problem.motion.course[gaits]
    course[-1] = course[-2] if c.time_s[-1] < ends[-1] - 1e-6 else course[-1]
    count = max(2, settings.track.nodes_per_cycle * len(plan.gaits))
    times = np.linspace(0.0, c.time_s[-1], count)
    x, y = linear(c.time_s, c.pose[:, :2], times).T
    speed = np.append(np.hypot(np.diff(x), np.diff(y)) / np.diff(times), np.nan)
    speed[-1] = speed[-2]
    backwards = np.array([steady[g] < 0 for g in way])
    cycle = np.minimum(np.searchsorted(ends, times, side="right") - 1, len(plan.gaits) - 1)
    speed = np.where(backwards[cycle], -speed, speed)
    pose = np.stack([x, y, np.interp(times, ends, course)], axis=1)
    reference = Reference(pose, speed, c.time_s[-1] - times, np.array(played)[cycle])
    return _beyond(reference, problem.robot.length_m, settings)


def _beyond(reference: Reference, length_m: float, settings: DriveSettings) -> Reference:
    """Return the reference drawn out straight past its end, so that the goal is driven through."""
    x, y, course = reference.pose[-1]
    speed = float(reference.speed_m_s[-1])
    far = math.copysign(1.0, speed) * np.linspace(0.0, settings.beyond * length_m, 6)[1:]
    line = np.stack(
        [x + far * math.cos(course), y + far * math.sin(course), np.full(far.size, course)], axis=1
    )
    later = -np.abs(far) / max(abs(speed), settings.slowest * length_m)
    return Reference(
        np.concatenate([reference.pose, line]),
        np.append(reference.speed_m_s, np.full(far.size, speed)),
        np.append(reference.left_s, later),
        np.append(reference.gait, np.full(far.size, reference.gait[-1])),
    )

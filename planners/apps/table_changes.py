"""What a gait table tells a controller of changes of gait, simulated as the planner's motion table is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planners.motion.settings import MOTION_TABLE
from planners.motion.table import courses
from planners.motion.transitions import Progress, every_cycle
from planners.motion.valves import ValveLimits
from srs_opt.gait_opt.changes import LEVELS, Changes
from srs_opt.gait_opt.table import GaitTable, TableGait
from srs_opt.model.state import FORWARD, POSE
from srs_opt.orbit.body import integrator
from srs_opt.robot import Robot


def with_changes(
    robot: Robot, table: GaitTable, *, min_dwell_s: float, tick_s: float, progress: Progress = iter
) -> GaitTable:
    """Return the table with what a cycle of every gait does after every gait and from rest.

    Parameters
    ----------
    table : GaitTable
        Its gaits switch on the controller's ticks and keep the least dwell.
    min_dwell_s, tick_s : float
    progress : callable
        Wraps the iteration over the gaits that come before.
    """
    run, limits = integrator(robot, table.model), ValveLimits(min_dwell_s, tick_s)
    n = len(table.gaits)
    speeds = [entry.speed_m_s for entry in table.gaits]
    fastest, slowest = max(0.0, *speeds), min(0.0, *speeds)

    def levels(entry: TableGait) -> np.ndarray:
        shares = np.array(MOTION_TABLE.controller_levels)
        return shares * MOTION_TABLE.speed_margin * (fastest if entry.speed_m_s >= 0 else slowest)

    speed, moved = np.zeros((n + 1, LEVELS)), np.zeros((n + 1, n, LEVELS, 4))
    for before, (begun, cycles) in enumerate(every_cycle(run, table, limits, levels, progress)):
        speed[before] = begun
        for now, level, last, samples in cycles:
            moved[before, now, level] = (*samples[-1, POSE], last[FORWARD])
    speed[n], moved[n] = np.linspace(-1e-3, 1e-3, LEVELS), moved[n, :, :1]  # from rest: one speed only
    steady = np.array([entry.displacement for entry in table.gaits])
    course = np.append(courses(steady, MOTION_TABLE.still * robot.body_width_m), 0.0)
    return replace(table, changes=Changes.of_floats(speed, course, moved))

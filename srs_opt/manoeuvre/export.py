"""A manoeuvre as JSON, as a program for the valve controller, and as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from srs_opt.controller.program import ControllerLimits, Program, ProgramGait, events_of
from srs_opt.figures import COLOURS, LEFT, PAGE_IN, RIGHT, draw_body, new_figure, save_figure, styled
from srs_opt.gait_opt.goal import chamber_volume_m3, fill_work_j
from srs_opt.gait_opt.ticks import Schedule
from srs_opt.geometry import points_in_room
from srs_opt.manoeuvre.search import Manoeuvre
from srs_opt.manoeuvre.task import Task
from srs_opt.robot import Robot
from srs_opt.simulate.integrate import Integrator, Trajectory
from srs_opt.simulate.shapes import centre_lines

BODIES = 9  # drawn


def record_of(run: Integrator, task: Task, found: Manoeuvre) -> dict[str, Any]:
    """Return the JSON object of the command."""
    plan, path = found.plan, found.trajectory
    points = bodies(run, path, np.unique(np.append(path.time_s[::5], path.time_s[-1])))
    x, y, heading = (float(v) for v in path.pose[-1])
    u, v, _ = (float(w) for w in path.velocity[-1])
    return {
        "objective": task.objective,
        "start": {"gait": None if task.start.gait is None else task.start.gait.record()},
        "duration_s": plan.duration_s,
        "pressure_kpa": plan.pressure_kpa,
        "end": {"x_m": x, "y_m": y, "heading_rad": heading, "speed_m_s": float(np.hypot(u, v))},
        "switches": plan.switch_records(),
        "fills": plan.fills,
        "air_j": fill_work_j(plan.fills, plan.pressure_kpa, chamber_volume_m3(run.robot)),
        "space_m": 2 * disc_radius_m(points, run.robot.body_width_m / 2),
        "certificate": found.certificate.record(),
        "exact_s": found.exact_s,
        "first_s": found.first_s,
        "starts": found.starts,
        "solves": found.solves,
    }


def disc_radius_m(points: np.ndarray, half_width_m: float) -> float:
    """Return the radius of the smallest disc that holds all bodies (n, points, 2)."""
    import shapely

    circle = shapely.minimum_bounding_radius(shapely.MultiPoint(points.reshape(-1, 2)))
    return float(circle) + half_width_m


def bodies(run: Integrator, path: Trajectory, times_s: np.ndarray) -> np.ndarray:
    """Return the centre lines (n, points, 2) in the room at some instants."""
    pose, kappa = path.at(times_s)
    line = centre_lines(run, kappa)
    return points_in_room(line, pose)


def program_of(robot: Robot, task: Task, found: Manoeuvre) -> Program:
    """Return the program that plays the manoeuvre once and then vents.

    A manoeuvre that begins in a gait has that gait before it: the controller is told when to go on.
    """
    plan, tick = found.plan, task.bounds.tick_s
    limits = ControllerLimits(dwell_s=task.bounds.min_dwell_s)
    events, ticks = events_of(plan.timeline(), tick)
    schedule = Schedule(ticks, tuple(events))
    whole = ProgramGait("manoeuvre", schedule, plan.pressure_kpa, 0.0, 0.0)
    gaits, steps = [whole], [(0, 1)]
    for gait, name, first in ((task.start.gait, "before", True), (_after(task), "after", False)):
        if gait is not None:
            gaits.append(ProgramGait.of_gait(name, gait, 0.0, 0.0, tick))
            step = (len(gaits) - 1, CYCLES_AROUND)
            steps = [step, *steps] if first else [*steps, step]
    return Program(robot.name, robot.segments, tick, tuple(gaits), tuple(steps), limits)


CYCLES_AROUND = 8  # of the gaits before and after; they settle within three


def _after(task: Task) -> Any:
    return None if task.end.orbit is None else task.end.orbit.gait


@styled
def draw_manoeuvre(run: Integrator, task: Task, found: Manoeuvre, stem: Path) -> tuple[Path, Path]:
    """Draw the body at even instants in its room, and the valves over time; return the files written."""
    path = found.trajectory
    figure, (room, valves) = new_figure(
        1, 2, width_in=PAGE_IN, height_in=2.9, gridspec_kw={"width_ratios": [1.5, 1]}
    )
    if task.space is not None:
        x, y = np.asarray(task.space.region.exterior.coords).T
        room.plot(x, y, color=COLOURS[7], linewidth=0.8)
    shown = np.linspace(0, path.time_s[-1], BODIES)
    for k, line in enumerate(bodies(run, path, shown)):
        x, y = line.T
        shade = 0.15 + 0.7 * k / (BODIES - 1)
        draw_body(room, x, y, run.robot.body_width_m, color=COLOURS[0], alpha=shade)
    room.plot(path.pose[:, 0], path.pose[:, 1], color=COLOURS[6], linewidth=0.8)
    room.set_aspect("equal", adjustable="datalim")
    room.set_xlabel("x (m)")
    room.set_ylabel("y (m)")
    room.set_title(f"body at {BODIES} instants, {found.plan.duration_s:.3f} s in all")
    for segment, row in enumerate(found.plan.rows, start=1):
        edges = [0.0, *row.times_s, found.plan.duration_s]
        for state, begin, end in zip(row.states, edges, edges[1:]):
            if state:
                colour = LEFT if state > 0 else RIGHT
                valves.barh(segment, end - begin, left=begin, height=0.7, color=colour, linewidth=0)
    valves.set_xlabel("time (s)")
    valves.set_ylabel("segment, from the tail")
    valves.set_yticks(range(1, len(found.plan.rows) + 1))
    valves.set_title("valves: blue left, orange right")
    return save_figure(figure, stem)

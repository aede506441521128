"""What a page or another program needs to replay a run: maze, body, gaits and clearance, in one JSON file."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from planners.maze.maze import Maze
from planners.plan.answer import Plan
from planners.plan.certify import clearances
from planners.search.problem import Problem
from planners.view.settings import VIEW
from srs_opt.files import write_text
from srs_opt.simulate.interpolate import linear

if TYPE_CHECKING:
    from planners.drive.execute import Execution
    from srs_opt.gait_opt.table import TableGait
    from srs_opt.simulate.timeline import Timeline

VERSION = 2
WALL_GREY, UNKNOWN_GREY = 0x3A, 0xB4
Array = NDArray[np.float64]


def save_motion(path: Path, problem: Problem, plan: Plan, execution: Execution | None = None) -> Path:
    """Write the plan's motion, and that of its execution where there is one, as motion.json."""
    import json

    record = motion_record(problem, plan, execution)
    return write_text(path, json.dumps(record, separators=(",", ":"), allow_nan=False) + "\n")


def motion_record(problem: Problem, plan: Plan, execution: Execution | None = None) -> dict[str, Any]:
    """Return the JSON object of motion.json (schema: motion.schema.json)."""
    c = plan.certificate
    starts_s = np.concatenate([[0.0], np.cumsum(problem.motion.periods(plan.gaits))[:-1]])
    rest = problem.motion.rest
    planned = list(zip((rest, *plan.gaits), plan.gaits, starts_s))
    runs = [_run("planned", problem, planned, c.time_s, c.pose, c.lines)]
    if execution is not None:
        e = execution
        before = [rest, *e.gaits][: len(e.gaits)]
        for start_s, _ in e.halts:
            after = int(np.searchsorted(e.starts_s, start_s))
            if after < len(before):
                before[after] = rest
        runs.append(
            _run("driven", problem, list(zip(before, e.gaits, e.starts_s)), e.time_s, e.pose, e.lines)
            | {"outcome": e.reason, "halts": [_halt(*halt) for halt in e.halts]}
        )
    row = problem.motion.row
    used = sorted({row(gait) for run in runs for _, gait, _ in run["cycles"]})
    pairs = {(before, gait) for run in runs for before, gait, _ in run["cycles"]}
    joining = sorted(pair for pair in pairs if not problem.joints.is_plain(*pair))
    for run in runs:
        run["cycles"] = [
            [
                used.index(row(gait)),
                start,
                joining.index((before, gait)) if (before, gait) in joining else None,
            ]
            for before, gait, start in run["cycles"]
        ]
    limits = problem.joints.limits
    return {
        "version": VERSION,
        "robot": problem.robot.name,
        "body_width_m": problem.robot.body_width_m,
        "margin_m": problem.margin_m,
        "maze": maze_record(problem.maze),
        "valves": asdict(limits),
        "gaits": [_gait(problem.gaits.gaits[k]) for k in used],
        "joining": [_joining(problem, before, gait) for before, gait in joining],
        "runs": runs,
    }


def _joining(problem: Problem, before: int, gait: int) -> dict[str, Any]:
    """Return the cycle with which a gait begins after another (or rest), or one made for the plan."""
    joint = problem.joints.joint(before, gait)
    assert joint is not None  # it has been played
    row, entries = problem.motion.row, problem.gaits.gaits
    after = None if before == problem.motion.rest else entries[row(before)].name
    record = {"gait": entries[row(gait)].name, "after": after, **joint.gait.record()}
    return record | {"from_kpa": joint.from_kpa, "ramp_s": round(joint.ramp_s, 6)}


def _halt(start_s: float, valves: Timeline) -> dict[str, Any]:
    return {
        "start_s": round(start_s, 5),
        "duration_s": np.round(valves.duration_s, 6).tolist(),
        "valve": valves.valve.astype(int).tolist(),
        "pressure_kpa": np.round(valves.pressure_kpa, 4).tolist(),
    }


def _run(
    name: str,
    problem: Problem,
    cycles: Sequence[tuple[int, int, float]],
    time_s: Array,
    pose: Array,
    lines: Array,
) -> dict[str, Any]:
    """Return one motion at even instants: body in tenths of a millimetre, clearance in millimetres.

    Cycles are (gait before, gait, start in s).
    """
    count = min(VIEW.most_recorded_frames, max(2, math.ceil(float(time_s[-1]) / VIEW.recorded_frame_s) + 1))
    instants = np.linspace(0.0, float(time_s[-1]), count)
    body, centre = linear(time_s, lines, instants), linear(time_s, pose, instants)
    room = clearances(problem, body, VIEW.shown_clearance_m).clip(max=VIEW.shown_clearance_m)
    return {
        "name": name,
        "duration_s": round(float(time_s[-1]), 5),
        "cycles": [[int(b), int(g), round(float(t), 6)] for b, g, t in cycles if t < time_s[-1]],
        "centre": np.round(1e4 * centre[:, :2]).astype(int).tolist(),
        "body": np.round(1e4 * body).astype(int).reshape(count, -1).tolist(),
        "clearance_mm": np.round(1e3 * room, 2).tolist(),
    }


def _gait(entry: TableGait) -> dict[str, Any]:
    return {
        "name": entry.name,
        **entry.gait.record(),
        "speed_m_s": entry.speed_m_s,
        "turn_rate_rad_s": entry.turn_rate_rad_s,
    }


def maze_record(maze: Maze) -> dict[str, Any]:
    """Return bounds, wall outlines, cells, start and goal as motion.json holds them."""
    rings = []
    if len(maze.walls):
        inside = maze.walls.union & shapely.box(*maze.bounds)
        rings = [
            np.round(np.asarray(ring.coords), 5).tolist()
            for part in shapely.get_parts(inside)
            if part.geom_type == "Polygon"
            for ring in (part.exterior, *part.interiors)
        ]
    start, goal = maze.start, maze.goal
    return {
        "name": maze.name,
        "bounds": list(maze.bounds),
        "rings": rings,
        "cells": _cells(maze),
        "start": start and [start.x, start.y, start.heading],
        "goal": goal
        and {
            "x": goal.x,
            "y": goal.y,
            "radius": goal.radius,
            "boxes": [list(b) for b in goal.boxes],
            "heading": goal.heading,
        },
    }


def _cells(maze: Maze) -> dict[str, Any] | None:
    """Return occupied cells as a transparent picture, its lower left corner, turn and size."""
    raster = maze.raster
    if raster is None:
        return None
    from PIL import Image

    unknown = np.zeros_like(raster.occupied) if raster.unknown is None else raster.unknown
    alpha = Image.fromarray(((raster.occupied | unknown)[::-1] * np.uint8(255)).astype(np.uint8))
    grey = Image.fromarray(np.where(unknown[::-1], UNKNOWN_GREY, WALL_GREY).astype(np.uint8))
    picture = Image.merge("LA", (grey, alpha))
    stream = io.BytesIO()
    picture.save(stream, "PNG", optimize=True)
    return {
        "png": base64.b64encode(stream.getvalue()).decode("ascii"),
        "origin": [raster.origin.x, raster.origin.y, raster.origin.heading],
        "size": list(raster.size_m),
    }

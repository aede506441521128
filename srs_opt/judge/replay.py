"""A motion.json played in the engine: its valves, cycle after cycle, among its walls, without looking."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dart_snake.bending import Lags, respond
from dart_snake.engine import Motion, Snake
from srs_opt.document import read_json
from srs_opt.errors import InputError
from srs_opt.gait import Gait
from srs_opt.geometry import distance_along
from srs_opt.judge.bodies import body_of, drive_of, pull_of, slope_of
from srs_opt.judge.settings import AGREEMENT, ENGINE, REPLAY, EngineSettings
from srs_opt.judge.walls import boxes_of, clearances, solid_region
from srs_opt.robot import Robot
from srs_opt.simulate.timeline import Timeline

Array = NDArray[np.float64]
VERSION = 2  # of motion.json


@dataclass(frozen=True)
class Drift:
    """A motion in the engine beside ours, both open loop.

    Attributes
    ----------
    name : str
        planned, driven or manoeuvre.
    drift_m, way_m : float
        How far the centre of mass is from where we have it, in the end or at the first contact; length of our
        way until then.
    body_m : float
        Length of the robot.
    time_s, centre, lines : arrays (n,), (n, 2), (n, points, 2)
        The motion, body included.
    ours : array (m, 2)
        Our centre of mass.
    """

    name: str
    drift_m: float
    way_m: float
    body_m: float
    time_s: Array
    centre: Array
    lines: Array
    ours: Array

    @property
    def agrees(self) -> bool:
        """Whether the motions stay together until the end, or until drift has led to a wall."""
        least_m = AGREEMENT.least_drift_body * self.body_m
        return self.drift_m <= max(AGREEMENT.drift_share * self.way_m, least_m)

    def to_record(self) -> dict[str, Any]:
        """Return what judge.json says of every motion that is played."""
        return {
            "run": self.name,
            "drift_m": round(self.drift_m, 6),
            "way_m": round(self.way_m, 6),
            "duration_s": round(float(self.time_s[-1]), 4),
            "agrees": self.agrees,
        }


@dataclass(frozen=True)
class Replay(Drift):
    """A drive in the engine, among walls.

    Attributes
    ----------
    reached : bool
        Whether the centre of mass came to the goal.
    contacts : int
        How often the body came to touch a wall.
    first_contact_s : float or None
    smallest_clearance_m : float
    """

    reached: bool
    contacts: int
    first_contact_s: float | None
    smallest_clearance_m: float

    def to_record(self) -> dict[str, Any]:
        """Return the `drive` entry of judge.json."""
        return {
            **super().to_record(),
            "reached": self.reached,
            "contacts": self.contacts,
            "first_contact_s": self.first_contact_s,
            "smallest_clearance_m": round(self.smallest_clearance_m, 6),
        }

    def in_words(self) -> str:
        """Return what happened, in a line."""
        touched = "no wall touched"
        if self.contacts:
            touched = f"walls touched {self.contacts} times, first after {self.first_contact_s:.1f} s"
        goal = "goal reached" if self.reached else "goal not reached"
        return (
            f"{'agrees' if self.agrees else 'DISAGREES'}: the {self.name} cycles, played open loop: {goal}, "
            f"{touched}, smallest clearance {1e3 * self.smallest_clearance_m:.1f} mm; "
            f"{1e3 * self.drift_m:.0f} mm "
            f"from ours after {self.way_m:.2f} m"
        )


def load_motion(file: str) -> dict[str, Any]:
    """Read motion.json, or the one beside a plan.json.

    Raises
    ------
    InputError
        If it is none.
    """
    path = Path(file)
    if path.name == "plan.json":
        plan = read_json(path, "a plan (JSON of plan)").value
        if not isinstance(plan, dict) or plan.get("status") != "solved":
            raise InputError(f"{file}: not a solved plan, nothing to play")
        path = path.with_name("motion.json")
    document = read_json(path, "the motion of a plan (motion.json, which plan writes beside plan.json)")
    record = document.value
    needed = ("body_width_m", "maze", "gaits", "joining", "runs")
    if not isinstance(record, dict) or any(key not in record for key in needed):
        raise InputError(f"{path}: expected keys {', '.join(needed)}, as plan writes them")
    if record.get("version") != VERSION:
        found = record.get("version")
        raise InputError(f"{path}: version: this program reads version {VERSION}, found {found!r}")
    return record


def replay(robot: Robot, motion: Mapping[str, Any], settings: EngineSettings = ENGINE) -> Replay:
    """Play the last run of a motion (the drive, where it was driven) from rest at the maze's start.

    Raises
    ------
    InputError
        If the motion cannot be played by this robot.
    """
    run, maze = motion["runs"][-1], motion["maze"]
    try:
        phases = phases_of(motion, run)
        start = tuple(float(v) for v in maze["start"])
        # motion.json holds tenths of a millimetre
        ours = 1e-4 * np.array(run["centre"], dtype=float)
    except (TypeError, KeyError, ValueError, IndexError) as error:
        raise InputError(f"motion.json: its runs cannot be played ({json.dumps(str(error))})") from error
    if phases.valve.shape[0] != robot.segments:
        raise InputError(
            f"motion.json: its gaits drive {phases.valve.shape[0]} segments, robot '{robot.name}' has "
            f"{robot.segments}; name the robot with --robot"
        )
    duration = float(phases.duration_s.sum())
    snake = Snake(
        body_of(robot), (start[0], start[1], start[2]), step_s=whole_step_s(duration, settings),
        pairs=settings.pairs, walls=boxes_of(maze), slope=slope_of(robot), pull=pull_of(robot, room=True),
    )  # fmt: skip
    seen, centre = play_blind(robot, snake, phases)
    room = clearances(solid_region(maze), seen.line_m, robot.body_width_m)
    at_s = np.linspace(0.0, duration, len(ours))
    began = np.flatnonzero(np.diff(np.concatenate([[0], seen.touched.astype(int)])) > 0)
    last = int(began[0]) if began.size else len(centre) - 1
    there = np.array([np.interp(seen.time_s[last], at_s, ours[:, k]) for k in range(2)])
    until = ours[at_s <= seen.time_s[last] + 1e-9]
    return Replay(
        run["name"],
        float(np.hypot(*(centre[last] - there))),
        float(distance_along(until)[-1]),
        robot.length_m,
        seen.time_s,
        centre,
        seen.line_m,
        ours,
        bool(_in_goal(maze["goal"], centre).any()),
        int(began.size),
        float(seen.time_s[began[0]]) if began.size else None,
        float(room.min()),
    )


def whole_step_s(duration_s: float, settings: EngineSettings) -> float:
    """Return the step nearest below the wanted one that divides the duration."""
    return duration_s / math.ceil(duration_s / settings.step_s - 1e-9)


def play_blind(robot: Robot, snake: Snake, timeline: Timeline) -> tuple[Motion, Array]:
    """Play held valves from rest; return the engine's motion and its centre of mass (n, 2)."""
    drive = drive_of(robot, timeline.valve, timeline.pressure_kpa, timeline.frequency_hz)
    steps = round(timeline.end_s / snake.step_s)
    times = np.asarray(np.arange(1, steps + 1) * snake.step_s, dtype=np.float64)
    tau = (robot.tau1_s, robot.tau2_s)
    curvature, rate, _ = respond(Lags.rest(robot.segments), timeline.duration_s, drive, tau, times)
    seen = snake.play(curvature, rate, REPLAY.steps_per_row)
    masses = np.array([link.mass_kg for link in snake.body.links])
    return seen, np.stack([seen.x_m @ masses, seen.y_m @ masses], axis=1) / masses.sum()


def phases_of(motion: Mapping[str, Any], run: Mapping[str, Any]) -> Timeline:
    """Return what the valves do in a run: cycles until the next thing begins, halts, nothing in between."""
    things: list[tuple[float, Timeline]] = []
    for gait, start_s, joining in run["cycles"]:
        entry = motion["gaits"][gait] if joining is None else motion["joining"][joining]
        things.append((float(start_s), _cycle(entry)))
    for halt in run.get("halts", ()):
        duration = np.array(halt["duration_s"], dtype=float)
        valve = np.array(halt["valve"], dtype=float)
        pressure = np.array(halt["pressure_kpa"], dtype=float)
        things.append((float(halt["start_s"]), Timeline(duration, valve, pressure, np.ones(duration.size))))
    things.sort(key=lambda thing: thing[0])
    ends = [*(start for start, _ in things[1:]), float(run["duration_s"])]
    parts = [_until(played, end - start) for (start, played), end in zip(things, ends)]
    return Timeline.join(parts)


def _cycle(entry: Mapping[str, Any]) -> Timeline:
    """Return the phases of one cycle, a change of pressure in stairs at its means."""
    gait = Gait.of_record(dict(entry))
    durations, _ = gait.phases()
    edges = np.concatenate([[0.0], np.cumsum(durations)])
    ramp_s = float(entry.get("ramp_s", 0.0))
    if ramp_s > 0:
        edges = np.union1d(edges, np.linspace(0.0, ramp_s, math.ceil(ramp_s / REPLAY.stair_s) + 1))
        # edges that coincide but for rounding end one phase
        edges = edges[np.append(True, np.diff(edges) > 1e-9)]
    middles = (edges[:-1] + edges[1:]) / 2
    valve = np.stack([gait.valve(t) for t in middles], axis=1)
    pressure = np.full(middles.size, gait.pressure_kpa)
    if ramp_s > 0:
        pressure = np.interp(middles, [0.0, ramp_s], [float(entry["from_kpa"]), gait.pressure_kpa])
    return Timeline(np.diff(edges), valve, pressure, np.full(middles.size, gait.frequency_hz))


def _until(timeline: Timeline, end_s: float) -> Timeline:
    """Return a timeline cut off at an end, or vented until then."""
    cut = timeline.until(end_s)
    left_s = end_s - cut.end_s
    if left_s <= 1e-9:
        return cut
    pressure, frequency = float(timeline.pressure_kpa[-1]), float(timeline.frequency_hz[-1])
    return Timeline.join([cut, Timeline.vent(len(timeline.valve), left_s, pressure, frequency)])


def _in_goal(goal: Mapping[str, Any], centre: Array) -> NDArray[np.bool_]:
    """Return whether each point lies in the goal's disc or boxes."""
    boxes = goal.get("boxes") or []
    if not boxes:
        return np.asarray(
            np.hypot(centre[:, 0] - goal["x"], centre[:, 1] - goal["y"]) <= goal["radius"], dtype=np.bool_
        )
    x, y = centre.T
    inside = [(x0 <= x) & (x <= x1) & (y0 <= y) & (y <= y1) for x0, y0, x1, y1 in boxes]
    return np.asarray(np.any(inside, axis=0), dtype=np.bool_)

"""From a robot file to the engine's bodies, and from valves to the curvatures that its hinges are driven
to."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dart_snake.body import Body, Link
from dart_snake.engine import Pull
from srs_opt.errors import InputError
from srs_opt.judge.settings import REPLAY
from srs_opt.robot import Robot

Array = NDArray[np.float64]
# what a camera or a clock adds does not move the robot, and a delay of all valves moves it later
IGNORED = ("marker_offset", "camera_scale", "camera_tilt", "clock_offset", "dead_time")
BODY = ("gap_length", "head_mass", "tether_weight", "viscous_rolling", "wheel_toe", "single_wheel_toe")
ACTUATION = ("bending_resistance", "curvature_bias", "segment_bias", "supply_droop")
TETHER = ("tether_drag", "tether_viscous", "tether_pull")
KNOWN = (*IGNORED, *BODY, *ACTUATION, *TETHER, "floor_slope")
ROOM = ("tether_pull", "floor_slope")


def check_engine() -> None:
    """Raise InputError, saying what to do, if the engine is not installed."""
    if importlib.util.find_spec("dartpy") is None:
        raise InputError(
            "the judge is another physics engine, package 'dartpy', which this Python lacks: "
            "pip install 'srs-opt[judge]' (in the project's folder: pip install '.[judge]'); Linux only"
        )


def check_judge(robots: Sequence[Robot]) -> None:
    """Raise InputError if the engine is missing or cannot stand for one of the robots."""
    check_engine()
    for robot in robots:
        check_robot(robot)


def check_robot(robot: Robot) -> None:
    """Raise InputError if the engine cannot stand for the robot."""
    if robot.friction_law != "per_axis":
        raise InputError(
            f"robot '{robot.name}': the judge's snake rolls on wheels, which is friction_law per_axis; "
            f"found {robot.friction_law}"
        )
    for spec in robot.effects:
        if spec["name"] not in KNOWN:
            raise InputError(
                f"robot '{robot.name}': the judge does not build effect '{spec['name']}'; it builds "
                f"{', '.join(KNOWN)}"
            )


def body_of(robot: Robot) -> Body:
    """Return what the engine builds."""
    check_robot(robot)
    values = {str(spec["name"]): spec for spec in robot.effects}
    link = Link(
        robot.link_mass_kg,
        robot.link_inertia_kg_m2,
        robot.friction_tangential,
        robot.friction_normal,
        axle_damping_n_s_m=_size(values, "viscous_rolling", "damping"),
        toe_rad=_size(values, "wheel_toe", "angle"),
    )
    links = [link] * robot.links
    links[0] = replace(links[0], load_n=_size(values, "tether_weight", "load_n"))
    links[-1] = replace(links[-1], mass_kg=link.mass_kg + _size(values, "head_mass", "extra_kg"))
    if one := values.get("single_wheel_toe"):
        k = int(one["link"]) - 1
        links[k] = replace(links[k], toe_rad=links[k].toe_rad + float(one["angle"]))
    return Body(
        tuple(links),
        (robot.segment_length_m,) * robot.segments,
        robot.gap_length_m + _size(values, "gap_length", "extra_m"),
        robot.body_width_m,
        robot.gravity_m_s2,
        robot.bending_stiffness_n_m2,
        robot.gap_stiffness_n_m2,
        robot.bending_relaxation_s or 0.0,
    )


def drive_of(robot: Robot, valve: Array, pressure_kpa: Array, frequency_hz: Array) -> Array:
    """Return the curvature (n, N-1) that held valves (N-1, n) lead to without load, 1/m."""
    values = {str(spec["name"]): spec for spec in robot.effects}
    per_kpa = robot.curvature_per_pressure_1_m_kpa / (1 + _size(values, "bending_resistance", "ratio"))
    reach = per_kpa * pressure_kpa * (1 - _size(values, "supply_droop", "per_hz") * frequency_hz)
    drive = valve.T * reach[:, None] + _size(values, "curvature_bias", "bias")
    if one := values.get("segment_bias"):
        drive[:, int(one["segment"]) - 1] += float(one["bias"])
    return np.asarray(drive, dtype=float)


def pull_of(robot: Robot, *, room: bool) -> Pull | None:
    """Return what pulls at the tail link; with `room`, towards a place too."""
    values = {str(spec["name"]): spec for spec in robot.effects if spec["name"] in TETHER}
    if not room:
        values.pop("tether_pull", None)
    if not values:
        return None
    drag, damping = _size(values, "tether_drag", "force_n"), _size(values, "tether_viscous", "damping")
    anchor = values.get("tether_pull", {"force_n": 0.0, "ax_m": 0.0, "ay_m": 0.0})

    def pull(_: float, x: float, y: float, vx: float, vy: float) -> tuple[float, float, float]:
        # dry friction of the hose, smoothed at rest
        brake = damping + drag / math.sqrt(vx * vx + vy * vy + REPLAY.tether_speed_m_s**2)
        dx, dy = float(anchor["ax_m"]) - x, float(anchor["ay_m"]) - y
        towards = float(anchor["force_n"]) / max(math.hypot(dx, dy), 1e-9)
        return towards * dx - brake * vx, towards * dy - brake * vy, 0.0

    return pull


def slope_of(robot: Robot) -> tuple[float, float]:
    """Return angle and direction of the floor."""
    for spec in robot.effects:
        if spec["name"] == "floor_slope":
            return float(spec["angle"]), float(spec["direction"])
    return 0.0, 0.0


def _size(values: Mapping[str, Mapping[str, Any]], name: str, key: str) -> float:
    return float(values[name][key]) if name in values else 0.0

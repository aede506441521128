"""Robots as the planner sees them."""

from __future__ import annotations

from srs_opt.effects import known_effects
from srs_opt.robot import Robot


def with_friction_times(robot: Robot, along: float, across: float) -> Robot:
    """Return the robot with friction along and across the wheels so many times as large."""
    return robot.with_values(
        friction_tangential=along * robot.friction_tangential, friction_normal=across * robot.friction_normal
    )


def undelayed(robot: Robot) -> Robot:
    """Return the robot with valves that follow at once; a constant delay only shifts a plan in time."""
    effects = [dict(spec) for spec in robot.effects if known_effects()[spec["name"]].delay is None]
    if robot.valve_delay_s == 0 and len(effects) == len(robot.effects):
        return robot
    return robot.with_values(valve_delay_s=0.0, effects=effects)

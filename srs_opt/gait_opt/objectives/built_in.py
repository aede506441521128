"""The objectives that come with the library."""

from __future__ import annotations

import casadi as ca

from srs_opt.gait_opt.objectives.cycle import GaitCycle
from srs_opt.gait_opt.objectives.objective import Objective

BAND_UNIT_M = 0.05  # of a band's merit
RADIUS_WEIGHT_1_M = 10.0  # merit of a metre less radius
TURN_WEIGHT_S = 0.1  # merit of a radian per second


def speed(cycle: GaitCycle) -> ca.SX:
    """Return the speed along the path."""
    return cycle.speed_m_s


def economy(cycle: GaitCycle) -> ca.SX:
    """Return minus the cost of transport: (friction work + air) / (weight x distance)."""
    return -(cycle.friction_work_j + cycle.air_work_j) / (cycle.weight_n * cycle.distance_m)


def tightness(cycle: GaitCycle) -> ca.SX:
    """Return minus the radius's size."""
    return -RADIUS_WEIGHT_1_M * cycle.radius_m


def slimness(cycle: GaitCycle) -> ca.SX:
    """Return minus the width of the swept band."""
    return -cycle.band_m / BAND_UNIT_M


def turning(cycle: GaitCycle) -> ca.SX:
    """Return the turn rate's size."""
    return TURN_WEIGHT_S * ca.fabs(cycle.turn_rate_rad_s)


SPEED = Objective("speed", speed, "fastest", quick=True, unit="m/s")
TRANSPORT = Objective(
    "transport", economy, "least energy per weight and distance", least_speed=True,
    unit="less cost of transport",
)  # fmt: skip
TIGHTEST = Objective(
    "tightest", tightness, "smallest radius", turn="side", least_speed=True,
    unit="m less radius", unit_per_merit=1 / RADIUS_WEIGHT_1_M,
)  # fmt: skip
TURN = Objective(
    "turn", speed, "tightest turn (with --radius or --turn-rate: fastest)", least_speed=True, unit="m/s",
    unless_turn=TIGHTEST,
)  # fmt: skip
PIVOT = Objective(
    "pivot", turning, "most turn rate", turn="side", unit="rad/s", unit_per_merit=1 / TURN_WEIGHT_S
)
SLIM = Objective(
    "slim", slimness, "slimmest swept band", least_speed=True, needs_speed=True,
    unit="m less band", unit_per_merit=BAND_UNIT_M,
)  # fmt: skip

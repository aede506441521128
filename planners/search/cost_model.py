"""What a plan costs: time, length, nearness to walls, or air; all counted in seconds of the fastest gait.

The search adds up costs of cycles; the map of costs to the goal is made of costs per metre.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from planners.search.settings import COST
from srs_opt.gait import Gait
from srs_opt.gait_opt.goal import air_work_j, chamber_volume_m3
from srs_opt.gait_opt.table import GaitTable
from srs_opt.robot import Robot

Array = NDArray[np.float64]
Cost = Literal["time", "length", "clearance", "air"]
COSTS: tuple[Cost, ...] = get_args(Cost)


@dataclass(frozen=True, eq=False)
class CostModel:
    """Costs of the gaits of a table.

    Attributes
    ----------
    cost : Cost
    period_s, air_j, speed_m_s : array (gaits,)
        Of every gait: duration and compressed air of a cycle, mean speed.
    body_width_m : float
    """

    cost: Cost
    period_s: Array
    air_j: Array
    speed_m_s: Array
    body_width_m: float

    @staticmethod
    def of(cost: Cost, robot: Robot, table: GaitTable) -> CostModel:
        """Return the costs of a table's gaits."""
        gaits = [entry.gait for entry in table.gaits]
        air = [gait_air_j(robot, gait) for gait in gaits]
        speed = [abs(entry.speed_m_s) for entry in table.gaits]
        return CostModel(
            cost, np.array([g.period_s for g in gaits]), np.array(air), np.array(speed), robot.body_width_m
        )

    @property
    def start_up(self) -> float:
        """Return the extra cost of a start from rest (of air, more)."""
        return {"length": COST.time_share, "air": COST.start_up_air}.get(self.cost, COST.start_up_s)

    @property
    def top_speed_m_s(self) -> float:
        """Speed of the fastest gait."""
        return float(self.speed_m_s.max())

    @property
    def _air_w(self) -> float:
        """Air that the fastest gait takes per second."""
        fastest = int(self.speed_m_s.argmax())
        return float(self.air_j[fastest] / self.period_s[fastest])

    def of_cycles(self, gaits: NDArray[np.int64], pose: Array, spare_m: Array) -> Array:
        """Return the costs (n,) of a cycle of some gaits.

        Parameters
        ----------
        gaits : array of int (n,)
        pose : array (n, samples, 3)
            Over the cycle.
        spare_m : array (n,)
            Clearance beyond the margin.
        """
        period = self.period_s[gaits]
        if self.cost == "time":
            return period
        if self.cost == "clearance":
            return period * self._nearness(spare_m)
        if self.cost == "length":
            way = np.hypot(*np.diff(pose[..., :2], axis=-2).transpose(2, 0, 1)).sum(axis=-1)
            return np.asarray(way / self.top_speed_m_s + COST.time_share * period)
        return self.air_j[gaits] / self._air_w + COST.time_share * period

    def per_metre(self, in_time: Array, spare_m: Array) -> Array:
        """Return costs per metre where a metre takes `in_time` seconds and `spare_m` is beside the body."""
        if self.cost == "time":
            return in_time
        if self.cost == "clearance":
            return in_time * self._nearness(spare_m)
        if self.cost == "length":
            return np.full(in_time.shape, 1 / self.top_speed_m_s) + COST.time_share * in_time
        moving = self.speed_m_s > COST.slow * self.top_speed_m_s
        least = (self.air_j[moving] / (self.speed_m_s[moving] * self.period_s[moving])).min()
        price: Array = COST.typical_over_least * least / self._air_w + COST.time_share * in_time
        return price

    def _nearness(self, spare_m: Array) -> Array:
        """Return the factor on the cost near walls."""
        return 1 + COST.near_factor * np.clip(1 - spare_m / (COST.near_widths * self.body_width_m), 0.0, 1.0)


def gait_air_j(robot: Robot, gait: Gait) -> float:
    """Return the energy of the air that a cycle of a gait takes."""
    return float(air_work_j(sum(map(len, gait.intervals)), gait.pressure_kpa, chamber_volume_m3(robot)))

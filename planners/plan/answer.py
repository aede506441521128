"""What a planner answers: the steps, the certified motion, or why there is none."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any, Literal

import numpy as np

from planners.plan.certify import Certificate
from planners.search.cost_model import gait_air_j
from planners.search.problem import Problem
from srs_opt.simulate.interpolate import linear

Status = Literal["solved", "infeasible", "not_found", "timeout"]
PATH_STEP_S = 0.05  # of the path in the record


@dataclass(frozen=True)
class Plan:
    """A sequence of gaits, a cycle each, with its certificate.

    Attributes
    ----------
    planner : str
    gaits : tuple of int
        Index into the gait table for every cycle.
    certificate : Certificate
    """

    planner: str
    gaits: tuple[int, ...]
    certificate: Certificate

    @property
    def duration_s(self) -> float:
        """Time from the start until arrival."""
        return float(self.certificate.time_s[-1])

    @property
    def length_m(self) -> float:
        """Length of the way of the centre of mass."""
        return float(np.hypot(*np.diff(self.certificate.pose[:, :2], axis=0).T).sum())

    def cost(self, problem: Problem) -> float:
        """Return what the plan costs by the problem's cost, in seconds of the fastest gait."""
        c, gaits = self.certificate, np.array(self.gaits)
        within = [np.flatnonzero(c.cycle == k) for k in range(len(gaits))]
        poses = [c.pose[max(k[0] - 1, 0) : k[-1] + 1] for k in within if k.size]
        spares = [np.array([c.room_m[k].min() - problem.margin_m]) for k in within if k.size]
        whole = zip(gaits[:, None], poses, spares)
        costs = [float(problem.cost_model.of_cycles(g, pose[None], spare)[0]) for g, pose, spare in whole]
        # of the last cycle only what was played until arrival counts
        last = problem.motion.period_s[gaits[len(costs) - 1]]
        left = float(problem.motion.period_s[gaits[: len(costs)]].sum()) - self.duration_s
        cost: float = sum(costs) - costs[-1] * min(left / last, 1.0)
        return cost

    def air_j(self, problem: Problem) -> float:
        """Return the energy of the air that the plan's cycles take."""
        return sum(gait_air_j(problem.robot, problem.joints.gait(number)) for number in self.gaits)

    def steps(self, problem: Problem) -> list[dict[str, Any]]:
        """Return the gaits in order, each with the number of cycles that it is held."""
        entries = problem.gaits.gaits
        return [
            {
                "gait": entries[gait].name,
                "cycles": len(list(run)),
                "reverse": entries[gait].speed_m_s < 0,
            }
            for gait, run in groupby(problem.motion.rows(self.gaits))
        ]

    def path(self) -> list[dict[str, float]]:
        """Return the way as a list of times and poses."""
        c = self.certificate
        times = np.append(np.arange(0.0, self.duration_s, PATH_STEP_S), self.duration_s)
        rows = np.column_stack([times, linear(c.time_s, c.pose, times)])
        keys = ("t_s", "x_m", "y_m", "heading_rad")
        return [dict(zip(keys, map(float, row))) for row in np.round(rows, 6)]


@dataclass(frozen=True)
class PlanResult:
    """The answer of `plan`, solved or not.

    Attributes
    ----------
    status : {"solved", "infeasible", "not_found", "timeout"}
        Infeasible only with a proof: walls that separate start and goal, or a place narrower than the body.
    plan : Plan or None
    reason : str or None
        In words, when not solved.
    planning_s : float
    effort : dict
        What the planners did (nodes, rounds), for the record.
    """

    status: Status
    plan: Plan | None
    reason: str | None
    planning_s: float
    effort: dict[str, Any] = field(default_factory=dict)

    def to_record(self, problem: Problem) -> dict[str, Any]:
        """Return the JSON object of the command (without execution)."""
        plan = self.plan
        record: dict[str, Any] = {"status": self.status, "planner": plan.planner if plan else None}
        record["planning_s"] = round(self.planning_s, 4)
        record["length_m"] = plan and round(plan.length_m, 5)
        record["duration_s"] = plan and round(plan.duration_s, 5)
        record["clearance_m"] = plan and math.floor(1e6 * plan.certificate.clearance_m) / 1e6
        record["error_bound_m"] = plan and math.ceil(1e7 * plan.certificate.error_m) / 1e7
        record["certified"] = bool(plan and plan.certificate.passed)
        record["margin_m"] = problem.margin_m
        record["cost"] = problem.cost
        record["air_j"] = plan and round(plan.air_j(problem), 4)
        record["steps"] = plan.steps(problem) if plan else []
        record["path"] = plan.path() if plan else []
        record["reason"] = self.reason
        record["effort"] = self.effort
        return record

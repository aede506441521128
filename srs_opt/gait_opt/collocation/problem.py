"""One optimization problem in numbers: robots, goal and limits become bounds and parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from srs_opt.gait_opt.collocation.goal_rows import GoalKind, Times
from srs_opt.gait_opt.collocation.guess import parameter_numbers
from srs_opt.gait_opt.collocation.layout import ENVELOPE_UNIT_M, PRESSURE_UNIT_KPA, Layout, Mesh
from srs_opt.gait_opt.collocation.point import QUADRATURES, PointKind
from srs_opt.gait_opt.collocation.program import IPOPT, Program, program
from srs_opt.gait_opt.collocation.solver import Solver
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.objectives.objective import Formulas, formulas
from srs_opt.gait_opt.settings import COLLOCATION, GOAL
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.robot import Robot


@dataclass(frozen=True)
class CycleProblem:
    """What to solve: the same gait for all `robots`, the worst of them counts.

    Attributes
    ----------
    robots : tuple of Robot
        The first is the nominal one: it keeps a wanted turn exactly, the others within tolerance.
    model : str
    goal : Goal
    limits : Limits
    intervals : int
        On-intervals per segment.
    relaxed : bool
        Valves may take any value in [-1, 1], on a grid of the mesh's elements.
    solver : Solver
    weights : tuple of float
        By which every robot's merit is multiplied before they are compared; empty: all one.
    """

    robots: tuple[Robot, ...]
    model: str
    goal: Goal
    limits: Limits
    intervals: int = 1
    relaxed: bool = False
    solver: Solver = IPOPT
    weights: tuple[float, ...] = ()

    def weight(self, robot: int) -> float:
        """Return the factor of a robot's merit."""
        return self.weights[robot] if self.weights else 1.0

    @property
    def formulas(self) -> Formulas:
        """The objective's formulas for these robots and valves."""
        return formulas(self.goal.aim, self.robots[0].segments, self.intervals)

    @property
    def needs_envelope(self) -> bool:
        """Whether the swept band enters the problem."""
        return self.goal.envelope_m is not None or self.formulas.uses_band

    def kinds(self, ordered: bool = False) -> tuple[PointKind, ...]:
        """Return the equations of every robot."""
        return tuple(
            PointKind(
                Structure.of(r, self.model, room=False),
                self.intervals,
                ordered,
                self.needs_envelope,
                self.limits.max_curvature_1_m is not None,
                self.relaxed,
            )
            for r in self.robots
        )

    def layout(self, elements: int, ordered: bool = False) -> Layout:
        """Return where the unknowns stand."""
        return Layout(self.kinds(ordered), elements)

    def program(self, elements: int, times: Times | None = None) -> Program:
        """Return the assembled program for a number of elements (or for phases that end at switches)."""
        kind = GoalKind(self.goal.aim, self.goal.radius_m is not None, self.goal.envelope_m is not None)
        if times is not None:
            return Program(self.layout(elements, ordered=True), kind, times)
        return program(self.layout(elements), kind)

    def parameters(
        self,
        p: Program,
        mesh: Mesh,
        scales: list[np.ndarray],
        friction_speed_m_s: float,
        merit_unit: float = 1.0,
    ) -> np.ndarray:
        """Return the program's parameters at one smoothing speed, the merit in units of `merit_unit`."""
        limits, goal = self.limits.for_robot(self.robots[0]), self.goal
        numbers = [
            limits.min_dwell_s,
            # 1: a number where no row asks for one
            goal.radius_m or 1.0,
            goal.envelope_m or 1.0,
            limits.chamber_volume_m3 or 0.0,
            *(weight_n(robot) for robot in self.robots),
            *(merit_unit / self.weight(r) for r in range(len(self.robots))),
        ]
        if p.times is None:
            place = np.stack([mesh.points(), np.repeat(np.diff(mesh.edges), 3)], axis=1).ravel()
            turns = np.zeros(p.layout.kinds[0].switches * p.layout.points)
        else:
            place, turns = p.times.constant, p.times.turns.ravel()
        half_width = COLLOCATION.switch_half_width * np.diff(mesh.edges).mean()
        parts = [place, np.array(numbers), np.array([half_width])]
        for robot, kind, scale in zip(self.robots, p.layout.kinds, scales):
            smoothed = replace(robot, friction_speed_m_s=max(friction_speed_m_s, robot.friction_speed_m_s))
            parts += [parameter_numbers(smoothed, kind), scale, turns]
        return np.concatenate(parts)

    def bounds(self, p: Program) -> tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
        """Return bounds of unknowns and rows."""
        return self._unknown_bounds(p.layout), self._row_bounds(p)

    def _unknown_bounds(self, layout: Layout) -> tuple[np.ndarray, np.ndarray]:
        low, high = np.full(layout.size, -np.inf), np.full(layout.size, np.inf)
        limits, goal = self.limits, self.goal
        low[0], high[0] = limits.frequency_hz
        low[1], high[1] = (v / PRESSURE_UNIT_KPA for v in limits.pressure_kpa)
        if self.relaxed:
            low[2 : layout.merit], high[2 : layout.merit] = -1.0, 1.0
        else:
            low[2] = high[2] = 0.0  # the first switch sets the clock
        for r in range(len(self.robots)):
            speed, turn = layout.unknown(r, "speed"), layout.unknown(r, "turn_rate")
            low[speed], high[speed] = goal.floor_m_s or -COLLOCATION.fastest_m_s, COLLOCATION.fastest_m_s
            low[turn], high[turn] = self._turn_bounds(nominal=r == 0)
            for side in ("left", "right"):
                low[layout.unknown(r, side)] = 0.0
                high[layout.unknown(r, side)] = 20.0
        return low, high

    def _turn_bounds(self, nominal: bool) -> tuple[float, float]:
        goal = self.goal
        if goal.turn in ("radius", "any"):
            return -COLLOCATION.fastest_turn_rad_s, COLLOCATION.fastest_turn_rad_s
        if goal.turn == "side":
            low, high = sorted(
                (goal.sense * GOAL.least_turn_rad_s, goal.sense * COLLOCATION.fastest_turn_rad_s)
            )
            return low, high
        wanted = goal.turn_rate_rad_s or 0.0
        spare = (
            0.0
            if nominal
            else COLLOCATION.other_robots_share * max(GOAL.straight_rad_s, GOAL.turn_error * abs(wanted))
        )
        return wanted - spare, wanted + spare

    def _row_bounds(self, p: Program) -> tuple[np.ndarray, np.ndarray]:
        low, high = [], []
        for robot, kind in zip(self.robots, p.layout.kinds):
            n = p.layout.elements
            equations = kind.states * p.layout.points + QUADRATURES
            low.append(np.zeros(equations))
            high.append(np.zeros(equations))
            half = robot.body_width_m / 2
            reach = 2 * kind.structure.links - 1 if kind.envelope else 0
            for _ in range(reach):
                low.append(np.concatenate([np.full(n, -np.inf), np.full(n, half)]))
                high.append(np.concatenate([np.full(n, -half), np.full(n, np.inf)]))
            if kind.curvature:
                most = self.limits.max_curvature_1_m or np.inf
                low.append(np.full(n * kind.segments, -most))
                high.append(np.full(n * kind.segments, most))
        low.append(p.goal.low)
        high.append(p.goal.high)
        return np.concatenate(low), np.concatenate(high)


@lru_cache(maxsize=64)
def weight_n(robot: Robot) -> float:
    """Return the robot's weight, effects on the mass included, N."""
    import casadi as ca

    structure = Structure.of(robot, room=False)
    parameters, mechanics, _ = build(structure)
    mass = ca.Function("mass", [parameters.vector], [ca.sum1(mechanics.mass)])
    return float(mass(parameters.pack(robot, 1.0, 1.0))) * robot.gravity_m_s2


__all__ = ["ENVELOPE_UNIT_M", "CycleProblem", "weight_n"]

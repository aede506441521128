"""The planning problem in OMPL's terms: one set-up that every planner is given.

State: SE(2) and the number of a node of `Memory`, which holds what OMPL need not know (the state of the
dynamic model, the gait before, the cost so far). Control: the gait table, a gait's index as a floored real,
held for one to a few cycles (`CycleControlSettings`). Propagator: cycles of the dynamic model. Validity: the
swept body keeps the margin; a cycle that does not gets the number -1. Objective: the cost of the problem
(`--cost`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from planners.search.problem import Cycle, Problem
from planners.search.settings import CYCLE_CONTROL
from planners.search.tree import Tree, arrival_index, at_rest

TOO_NEAR = -1  # in place of a node's number


@dataclass
class Memory:
    """Every node that the propagator made, by its number.

    Attributes
    ----------
    problem : Problem
    tree : Tree
    arrived : set of int
        Nodes in whose cycle the robot came to the goal; they absorb, so that a held gait ends there.
    """

    problem: Problem
    tree: Tree = field(default_factory=Tree)
    arrived: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Keep the start only."""
        root = at_rest(self.problem)
        self.tree, self.arrived = Tree(), set()
        self.tree.add(-1, root.gait, 0.0, Cycle(root.state, root.state[None, :3], root.state[None, None, :2]))

    def play(self, number: int, gait: int) -> int:
        """Simulate a cycle after a node and return its number, TOO_NEAR when it comes too near to a wall."""
        problem, tree = self.problem, self.tree
        if not 0 <= number < len(tree.gait):
            return TOO_NEAR
        if number in self.arrived:
            return number
        before = tree.gait[number]
        if not problem.motion.may_follow(before)[gait]:
            return TOO_NEAR
        (cycle,) = problem.simulate_all([(tree.cycle[number].state, before, gait)])
        if cycle is None:
            return TOO_NEAR
        slack = problem.start_slack_m
        if number:
            slack = CYCLE_CONTROL.slack * problem.robot.length_m + cycle.tube_m
        if not problem.body.keeps_margin(cycle.lines, slack):
            return TOO_NEAR
        return self.add(number, gait, cycle)

    def add(self, number: int, gait: int, cycle: Cycle) -> int:
        """Keep a cycle after a node and return its number."""
        problem = self.problem
        spare = problem.body.estimate(cycle.lines).min(keepdims=True) - problem.margin_m
        index = np.array([gait])
        cost = float(problem.cost_model.of_cycles(index, cycle.pose[None], spare)[0])
        new = self.tree.add(number, gait, self.tree.spent[number] + cost, cycle)
        if arrival_index(problem.goal, cycle.pose) is not None:
            self.arrived.add(new)
        return new

    def fill(self, state: Any, number: int) -> None:
        """Write a node into an OMPL state."""
        x, y, heading = (float(v) for v in self.tree.cycle[max(number, 0)].pose[-1])
        state[0].setX(x)
        state[0].setY(y)
        state[0].setYaw(math.remainder(heading, 2 * math.pi))
        state[1][0] = float(number)


@dataclass(frozen=True)
class CycleSetup:
    """OMPL's set-up of a problem.

    Attributes
    ----------
    problem : Problem
    memory : Memory
    setup : ompl.control.SimpleSetup
        With start, goal, propagator, validity checker and objective; without a planner.
    """

    problem: Problem
    memory: Memory
    setup: Any

    @property
    def information(self) -> Any:
        """`ompl.control.SpaceInformation`, of which planners are made."""
        return self.setup.getSpaceInformation()


def cycle_setup(problem: Problem) -> CycleSetup:
    """Return the problem as OMPL's planners are given it."""
    from ompl import base, control

    memory = Memory(problem)
    space = _state_space(base, problem)
    controls = control.RealVectorControlSpace(space, 1)
    bounds = base.RealVectorBounds(1)
    bounds.setLow(0.0)
    bounds.setHigh(float(problem.motion.size))
    controls.setBounds(bounds)
    setup = control.SimpleSetup(controls)
    info = setup.getSpaceInformation()
    info.setPropagationStepSize(1.0)  # the unit of durations is a cycle
    info.setMinMaxControlDuration(1, CYCLE_CONTROL.most_cycles)

    def propagate(state: Any, command: Any, duration: float, result: Any) -> None:
        number, gait = int(state[1][0]), gait_of(problem, command)
        for _ in range(max(1, round(duration))):
            number = memory.play(number, gait)
        memory.fill(result, number)

    setup.setStatePropagator(propagate)
    setup.setStateValidityChecker(lambda state: bool(state[1][0] >= 0))
    setup.setOptimizationObjective(_objective(base, info, memory))
    start = space.allocState()
    memory.fill(start, 0)
    setup.setStartState(start)
    setup.setGoal(_goal(base, info, problem, memory))
    return CycleSetup(problem, memory, setup)


def gait_of(problem: Problem, command: Any) -> int:
    """Return the gait that a control stands for."""
    gait: int = min(max(math.floor(command[0]), 0), problem.motion.size - 1)
    return gait


def gaits_of(problem: Problem, path: Any) -> tuple[int, ...]:
    """Return the gaits, a cycle each, of a path of OMPL's (`ompl.control.PathControl`)."""
    gaits: list[int] = []
    for k in range(path.getControlCount()):
        gaits += [gait_of(problem, path.getControl(k))] * max(1, round(path.getControlDuration(k)))
    return tuple(gaits)


def path_of(cycles: CycleSetup, gaits: Sequence[int]) -> Any:
    """Return OMPL's path of a sequence of gaits, simulated from the start until arrival."""
    from ompl import control

    info, memory = cycles.information, cycles.memory
    path = control.PathControl(info)
    number, before = 0, info.allocState()
    memory.fill(before, 0)
    path.append(before)
    state, command = info.allocState(), info.allocControl()
    for gait in gaits:
        if number in memory.arrived:
            break
        tree = memory.tree
        cycle = memory.problem.simulate(tree.cycle[number].state, tree.gait[number], gait)
        number = memory.add(number, gait, cycle)  # the planner has judged the room
        memory.fill(state, number)
        command[0] = gait + 0.5
        path.append(state, command, 1.0)
    return path


def _state_space(base: Any, problem: Problem) -> Any:
    plane = base.SE2StateSpace()
    xmin, ymin, xmax, ymax = problem.maze.bounds
    bounds = base.RealVectorBounds(2)
    for axis, (low, high) in enumerate(((xmin, xmax), (ymin, ymax))):
        bounds.setLow(axis, low)
        bounds.setHigh(axis, high)
    plane.setBounds(bounds)
    number = base.RealVectorStateSpace(1)
    rest = base.RealVectorBounds(1)
    rest.setLow(float(TOO_NEAR))
    rest.setHigh(1e9)
    number.setBounds(rest)
    space = base.CompoundStateSpace()
    space.addSubspace(plane, 1.0)
    space.addSubspace(number, 0.0)  # the number says nothing of distance
    space.lock()
    space.setup()
    place = base.SubspaceProjectionEvaluator(space, 0)  # EST and KPIECE1 count visits to places
    place.setup()
    for axis in range(place.getDimension()):
        place.setCellSizes(axis, problem.robot.length_m / 2)
    space.registerDefaultProjection(place)
    return space


def _goal(base: Any, info: Any, problem: Problem, memory: Memory) -> Any:
    class Arrived(base.GoalRegion):  # type: ignore[misc]
        """In the goal when any instant of the cycle was."""

        def __init__(self) -> None:
            super().__init__(info)
            self.setThreshold(1e-6)

        def distanceGoal(self, state: Any) -> float:
            number = int(state[1][0])
            if number in memory.arrived:
                return 0.0
            return CYCLE_CONTROL.away * problem.robot.length_m + float(
                problem.to_goal.at(memory.tree.cycle[max(number, 0)].pose[-1, :2])
            )

    return Arrived()


def _objective(base: Any, info: Any, memory: Memory) -> Any:
    class PriceOfCycles(base.OptimizationObjective):  # type: ignore[misc]
        """What the cycles between two nodes cost."""

        def __init__(self) -> None:
            super().__init__(info)

        def stateCost(self, state: Any) -> Any:
            return base.Cost(0.0)

        def motionCost(self, begin: Any, end: Any) -> Any:
            spent = memory.tree.spent
            return base.Cost(spent[max(int(end[1][0]), 0)] - spent[max(int(begin[1][0]), 0)])

    return PriceOfCycles()

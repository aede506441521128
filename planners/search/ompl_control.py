"""OMPL's control planners (RRT, EST, KPIECE1) over cycles of gaits, with the dynamic model as propagator.

OMPL keeps place and heading; the rest of the dynamic state stays here, in a list, and an OMPL state only
carries its number. A cycle whose body comes too near to a wall gets the number -1, which is not valid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from planners.search.ompl_setup import counted, seeded
from planners.search.problem import Cycle, Problem
from planners.search.tree import Step, arrival_index, at_rest

MOST_CYCLES = 6  # that one control is held
SLACK_M = 0.0005


@dataclass
class _Memory:
    """Every state that the propagator made: its cycle, the gait that led there, its parent."""

    cycle: list[Cycle] = field(default_factory=list)
    gait: list[int] = field(default_factory=list)
    parent: list[int] = field(default_factory=list)
    arrived: int | None = None

    def way_to(self, number: int) -> list[Step]:
        steps = []
        while self.parent[number] >= 0:
            steps.append(Step(self.gait[number], self.cycle[number]))
            number = self.parent[number]
        return steps[::-1]


def search_control(problem: Problem, planner: str, iterations: int, seed: int) -> list[Step] | None:
    """Return a way to the goal, or None.

    Parameters
    ----------
    problem : Problem
    planner : {"rrt", "est", "kpiece"}
    iterations : int
        After how many the planner gives up.
    seed : int
    """
    from ompl import base, control

    seeded(seed)
    memory = _Memory()
    root = at_rest(problem)
    memory.cycle.append(Cycle(root.state, root.state[None, :3], root.state[None, None, :2]))
    memory.gait.append(root.gait)
    memory.parent.append(-1)
    space = _state_space(base, problem)
    gaits = problem.motion.size
    controls = control.RealVectorControlSpace(space, 1)
    bounds = base.RealVectorBounds(1)
    bounds.setLow(0.0)
    bounds.setHigh(float(gaits))
    controls.setBounds(bounds)
    setup = control.SimpleSetup(controls)
    info = setup.getSpaceInformation()
    info.setPropagationStepSize(1.0)
    info.setMinMaxControlDuration(1, MOST_CYCLES)

    def propagate(state: Any, command: Any, duration: float, result: Any) -> None:
        number = int(state[1][0])
        gait = min(int(command[0]), gaits - 1)
        for _ in range(max(1, round(duration))):
            number = _play(problem, memory, number, gait)
        _fill(result, memory, number)

    setup.setStatePropagator(propagate)
    setup.setStateValidityChecker(lambda state: bool(state[1][0] >= 0))
    start = space.allocState()
    _fill(start, memory, 0)
    setup.setStartState(start)
    setup.setGoal(_goal(base, info, problem, memory))
    made = {"rrt": control.RRT, "est": control.EST, "kpiece": control.KPIECE1}[planner](info)
    setup.setPlanner(made)
    setup.setup()
    setup.solve(counted(iterations, lambda: memory.arrived is not None))
    return None if memory.arrived is None else memory.way_to(memory.arrived)


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
    rest.setLow(-1.0)
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


def _goal(base: Any, info: Any, problem: Problem, memory: _Memory) -> Any:
    class Arrived(base.GoalRegion):  # type: ignore[misc, name-defined]
        """In the goal when any instant of the cycle was."""

        def __init__(self) -> None:
            super().__init__(info)
            self.setThreshold(1e-6)

        def distanceGoal(self, state: Any) -> float:
            number = int(state[1][0])
            if memory.arrived is not None and number == memory.arrived:
                return 0.0
            return 0.01 + float(problem.to_goal.at(memory.cycle[max(number, 0)].pose[-1, :2]))

    return Arrived()


def _play(problem: Problem, memory: _Memory, number: int, gait: int) -> int:
    """Simulate a cycle and return its number, -1 when it comes too near to a wall."""
    if number < 0:
        return -1
    before = memory.gait[number]
    if not problem.motion.allowed[before, gait]:
        return -1
    cycle = problem.simulate(memory.cycle[number].state, before, gait)
    slack = problem.start_slack_m if number == 0 else SLACK_M + cycle.tube_m
    if not problem.body.keeps_margin(cycle.lines, slack):
        return -1
    memory.cycle.append(cycle)
    memory.gait.append(gait)
    memory.parent.append(number)
    new = len(memory.parent) - 1
    if memory.arrived is None and arrival_index(problem.goal, cycle.pose) is not None:
        memory.arrived = new
    return new


def _fill(state: Any, memory: _Memory, number: int) -> None:
    x, y, heading = (float(v) for v in memory.cycle[max(number, 0)].pose[-1])
    state[0].setX(x)
    state[0].setY(y)
    state[0].setYaw(math.remainder(heading, 2 * math.pi))
    state[1][0] = float(number)

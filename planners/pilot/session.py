"""One piloted drive from the first ping to the data set."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from planners.drive.execute import Drive, Execution, execute
from planners.pilot.observer import Latency
from planners.pilot.plant import PilotedPlant
from planners.pilot.pose import Camera, PoseSource
from planners.pilot.protocol import Fault
from planners.pilot.record import DriveLog
from planners.pilot.settings import PILOT
from planners.pilot.valve_line import Clock, LineStatistics, Port, ValveLine
from planners.plan.answer import Plan
from planners.search.problem import Problem
from srs_opt.controller.program import Program
from srs_opt.errors import InputError, NoAnswerError
from srs_opt.model.state import HEADING, X, Y


@dataclass(frozen=True)
class PilotedDrive:
    """What came of a drive.

    Attributes
    ----------
    execution : Execution
        As estimated from the camera.
    log : DriveLog
    latency : Latency
        By which sightings came late beyond their stamps.
    offset_m, residual_m : float
        Largest correction of a cycle's predicted place, and the largest rms of what it left.
    line : LineStatistics
    """

    execution: Execution
    log: DriveLog
    latency: Latency
    offset_m: float
    residual_m: float
    line: LineStatistics


def connect(port: Port, clock: Clock, program: Program) -> ValveLine:
    """Return the line to a controller that holds `program`.

    Raises
    ------
    InputError
        If it holds something else.
    NoAnswerError
        If it does not answer.
    """
    line = ValveLine(port, clock)
    hello = line.ping()
    if hello.fault is Fault.PROGRAM:
        raise InputError(f"the valve controller: {Fault.PROGRAM.in_words}")
    if hello.segments != program.segments or hello.program != program.identity:
        raise InputError(
            f"the valve controller holds program {hello.program:08x} ({hello.gaits} gaits, {hello.segments} "
            f"segments), these gaits are {program.identity:08x} ({len(program.gaits)} gaits, "
            f"{program.segments} segments): flash this table's header, or name the flashed table with --gaits"
        )
    return line


def pilot(
    problem: Problem,
    plan: Plan,
    program: Program,
    port: Port,
    source: PoseSource,
    clock: Clock,
    tell: Callable[[str], None] = lambda message: None,
    watch: Callable[[PilotedPlant], None] = lambda plant: None,
) -> PilotedDrive:
    """Drive the robot behind `port` along `plan`; its valves are vented in the end, whatever happens.

    Parameters
    ----------
    problem, plan
        What was planned.
    program : Program
        That the controller must hold.
    port, source, clock
        The valve line, the poses, and the time that both live in.
    tell : callable
        Takes messages for people.
    watch : callable
        Called with the plant whenever there is something new to show.

    Raises
    ------
    InputError
        If the controller holds another program, or the robot does not lie at the start.
    NoAnswerError
        If the controller does not answer, no pose comes, or the drive already fails in simulation.
    """
    line = connect(port, clock, program)
    # a rehearsal on the model: it also loads all code, so that the first real decision is not late
    begun_s = time.perf_counter()
    rehearsal = execute(problem, plan)
    decision_s = 2 * (time.perf_counter() - begun_s) / max(len(rehearsal.gaits), 1)
    if not rehearsal.reached:
        raise NoAnswerError(f"the drive already fails in simulation: {rehearsal.reason}")
    log = DriveLog()
    plant = PilotedPlant(problem, program, line, Camera(source), clock, log, tell, watch)
    plant.expect_decisions(min(decision_s, PILOT.longest_decision_s))
    _check_start(problem, plant.state)
    tell("driving")
    try:
        execution = Drive(problem, plan, plant, tell).go()
    finally:
        # a second interrupt while venting must not stop the venting
        with suppress(NoAnswerError):
            plant.stop()
    off = np.array(plant.corrections or [(0.0, 0.0)]).max(axis=0)
    return PilotedDrive(execution, log, plant.latency, float(off[0]), float(off[1]), line.statistics)


def _check_start(problem: Problem, state: np.ndarray) -> None:
    start = problem.start
    off_m = float(np.hypot(state[X] - start.x, state[Y] - start.y))
    off_rad = abs(float(state[HEADING]) - start.heading)
    if off_m > PILOT.at_start * problem.robot.length_m or off_rad > PILOT.at_start_rad:
        raise InputError(
            f"the robot lies at ({state[X]:.3f}, {state[Y]:.3f}), heading {state[HEADING]:.2f}; the start is "
            f"({start.x:.3f}, {start.y:.3f}), {start.heading:.2f}: move it there, or plan from its position: "
            f"--start {state[X]:.3f},{state[Y]:.3f},{state[HEADING]:.2f}"
        )

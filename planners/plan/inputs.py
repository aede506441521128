"""The planning problem from robot, gaits and maze, or from the command's options."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np

from planners.maze.load import load_maze
from planners.maze.maze import Maze
from planners.maze.placement import check_placement
from planners.maze.places import Goal, Pose, RobotSize
from planners.maze.raster import Unknown
from planners.motion.bending import Bending
from planners.motion.store import load_motion
from planners.motion.transitions import Progress
from planners.motion.valves import DEFAULT_LIMITS, ValveLimits, playable
from planners.plan.options import MARGIN_M
from planners.search.cost_model import Cost
from planners.search.problem import Problem
from planners.search.settings import RESOLUTION
from srs_opt.command import chosen_model, progress, say
from srs_opt.drive.calibration import NO_CALIBRATION, DriveCalibration, load_calibration
from srs_opt.errors import InputError
from srs_opt.gait_opt.robust import stiffness_deviation
from srs_opt.gait_opt.table import GaitTable, load_table
from srs_opt.model.parameters import room_effects
from srs_opt.robot import Robot, load_robot

Tell = Callable[[str], None]


def planning_problem(
    robot: Robot,
    maze: Maze,
    table: GaitTable,
    *,
    margin_m: float = MARGIN_M,
    valves: ValveLimits = DEFAULT_LIMITS,
    drive: DriveCalibration | None = None,
    cost: Cost = "time",
    tell: Tell = lambda message: None,
    show: Progress = iter,
) -> Problem:
    """Return the planning problem.

    Parameters
    ----------
    robot : Robot
    maze : Maze
        With start and goal, as `placed_maze` returns it.
    table : GaitTable
        Gaits that `valves` cannot play are left out.
    margin_m : float
        Clearance that the body keeps from walls.
    valves : ValveLimits
    drive : DriveCalibration, optional
        Its factors bend every cycle, its uncertainty is room that every cycle keeps.
    cost : {"time", "length", "clearance", "air"}
    tell, show : callable
        Get messages; wraps a long loop with progress.

    Raises
    ------
    InputError
        If the valves can play no gait of the table.
    """
    import scipy.ndimage
    import scipy.sparse.csgraph  # noqa: F401  (imported here so that planning time is planning time)

    table = table.for_planning()
    gaits = playable(robot, table, valves)
    if len(gaits.gaits) < len(table.gaits):
        tell(f"note: {len(gaits.gaits)} of {len(table.gaits)} gaits keep the valves' limits")
    motion = load_motion(robot, gaits, valves, show)
    if motion.deviation_m is not None:
        tell(
            f"note: stiffness known within {100 * stiffness_deviation(robot):.0f} %: a cycle may end "
            f"{1e3 * float(np.median(motion.deviation_m[:-1])):.1f} mm off (median gait, two standard "
            f"deviations); up to {1e3 * RESOLUTION.most_deviation * robot.length_m:.0f} mm of it are kept as "
            "room"
        )
    if drive is not None:
        motion = motion.bent(Bending(drive, motion.course))
        tell(
            f"note: cycles as measured: speed times {drive.speed.value:.3f}, radius times "
            f"{drive.radius.value:.3f}, uncertain by {1e3 * drive.margin_m(1.0):.1f} mm per metre"
        )
    return Problem(robot, gaits, motion, maze, margin_m, cost, drive or NO_CALIBRATION)


def check_margin(robot: Robot, margin_m: float) -> None:
    """Check the clearance that the body shall keep."""
    if not 0 <= margin_m < robot.length_m:
        raise InputError(f"--margin: expected 0 to {robot.length_m:.3g} m, found {margin_m:g}")


def problem_from(options: argparse.Namespace) -> Problem:
    """Return the planning problem of the command; bad input is an InputError.

    The maze is looked at first, so that a bad one is refused before anything slow.
    """
    robot = load_robot(options.robot)
    check_margin(robot, options.margin)
    maze = maze_from(options, robot)
    drive = None if options.drive is None else load_calibration(options.drive)
    return planning_problem(
        robot,
        maze,
        gaits_from(options, robot),
        margin_m=options.margin,
        valves=valve_limits(options),
        drive=drive,
        cost=options.cost,
        tell=lambda text: say(options, text),
        show=lambda rows: progress(rows, options, "changes of gait (once per gait table)"),
    )


def valve_limits(options: argparse.Namespace) -> ValveLimits:
    """Return what the valves' options say."""
    return ValveLimits(options.min_dwell, options.tick, options.pressure_rate)


def maze_from(options: argparse.Namespace, robot: Robot) -> Maze:
    """Return the maze with start and goal, both possible for the straight robot."""
    return placed_maze(
        robot,
        options.maze,
        options.margin,
        cell_m=options.cell,
        scale=options.scale,
        start=options.start,
        goal=options.goal,
        unknown=options.unknown,
    )


def placed_maze(
    robot: Robot,
    maze: Maze | Path | str,
    margin_m: float,
    *,
    cell_m: float | None = None,
    scale: float = 1.0,
    start: Pose | None = None,
    goal: Goal | None = None,
    unknown: Unknown = "wall",
) -> Maze:
    """Return the maze, read if need be, with start and goal; `start` and `goal` take its own's place.

    Raises
    ------
    InputError
        If it cannot be read, or the straight robot does not fit into its start.
    """
    size = RobotSize(robot.length_m, robot.body_width_m / 2, margin_m)
    if isinstance(maze, Maze):
        found = maze.with_places(start, goal)
    else:
        found = load_maze(
            maze,
            cell_m,
            scale,
            robot_length_m=size.length_m,
            body_half_width_m=size.half_width_m,
            margin_m=size.margin_m,
            start=start,
            goal=goal,
            unknown=unknown,
        )
    check_placement(found, size)
    return found


def gaits_from(options: argparse.Namespace, robot: Robot) -> GaitTable:
    """Return the gait table: that of --gaits, else the one built for this robot (built now if need be).

    With the gaits for drivers, of which planners make no use (`GaitTable.for_planning`).
    """
    return gaits_for(robot, options.gaits, chosen_model(options, robot), lambda text: say(options, text))


def gaits_for(
    robot: Robot, file: Path | None = None, model: str | None = None, tell: Tell = lambda message: None
) -> GaitTable:
    """Return the gait table in `file`, else the one built for `robot` (built now if need be, minutes)."""
    if file:
        return load_table(file, robot)
    from srs_opt.gait_opt.catalogue import default_table

    if unsteady := room_effects(robot):
        tell(f"note: planned without {', '.join(unsteady)}: they depend on the place, no gait is steady")
    if not robot.is_soft:
        tell(
            f"note: robot '{robot.name}' gives no bending stiffness: rigid actuators assumed; a body that "
            "bends moves otherwise (measure it; for unknown stiffness see gait_opt --table)"
        )
    return default_table(robot, model or robot.own_model, say=tell, driver=True)

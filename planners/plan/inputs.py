"""Robot, gaits and maze from the command's options."""

from __future__ import annotations

import argparse

from planners.maze.load import load_maze
from planners.maze.maze import Maze
from planners.maze.placement import check_placement
from planners.maze.places import RobotSize
from planners.motion.bending import Bending
from planners.motion.store import load_motion
from planners.motion.valves import ValveLimits, playable
from planners.search.problem import Problem
from srs_opt.command import chosen_model, progress, say
from srs_opt.drive.calibration import NO_CALIBRATION, load_calibration
from srs_opt.errors import InputError
from srs_opt.gait_opt.table import GaitTable, load_table
from srs_opt.model.parameters import room_effects
from srs_opt.robot import Robot, load_robot


def problem_from(options: argparse.Namespace) -> Problem:
    """Return the planning problem; bad input is an InputError.

    The maze is looked at first, so that a bad one is refused before anything slow.
    """
    import scipy.ndimage
    import scipy.sparse.csgraph  # noqa: F401  (imported here so that planning time is planning time)

    robot = load_robot(options.robot)
    if not 0 <= options.margin < robot.length_m:
        raise InputError(f"--margin: expected 0 to {robot.length_m:.3g} m, found {options.margin:g}")
    maze = maze_from(options, robot)
    limits = ValveLimits(options.min_dwell, options.tick, options.pressure_rate)
    table = gaits_from(options, robot)
    gaits = playable(robot, table, limits)
    if len(gaits.gaits) < len(table.gaits):
        say(options, f"note: {len(gaits.gaits)} of {len(table.gaits)} gaits keep the valves' limits")
    motion = load_motion(
        robot, gaits, limits, lambda rows: progress(rows, options, "changes of gait (once per gait table)")
    )
    drive = NO_CALIBRATION if options.drive is None else load_calibration(options.drive)
    if options.drive is not None:
        motion = motion.bent(Bending(drive, motion.course))
        say(
            options,
            f"note: cycles as measured: speed times {drive.speed.value:.3f}, radius times "
            f"{drive.radius.value:.3f}, uncertain by {1e3 * drive.margin_m(1.0):.1f} mm per metre",
        )
    return Problem(robot, gaits, motion, maze, options.margin, options.cost, drive)


def maze_from(options: argparse.Namespace, robot: Robot) -> Maze:
    """Return the maze with start and goal, both possible for the straight robot."""
    size = RobotSize(robot.length_m, robot.body_width_m / 2, options.margin)
    maze = load_maze(
        options.maze,
        options.cell,
        options.scale,
        robot_length_m=size.length_m,
        body_half_width_m=size.half_width_m,
        margin_m=size.margin_m,
        start=options.start,
        goal=options.goal,
        unknown=options.unknown,
    )
    check_placement(maze, size)
    return maze


def gaits_from(options: argparse.Namespace, robot: Robot) -> GaitTable:
    """Return the gait table: that of --gaits, else the one built for this robot (built now if need be)."""
    if options.gaits:
        return load_table(options.gaits, robot)
    from srs_opt.gait_opt.catalogue import default_table

    if unsteady := room_effects(robot):
        say(options, f"note: planned without {', '.join(unsteady)}: what depends on the room has no gait")
    return default_table(robot, chosen_model(options, robot), say=lambda text: say(options, text))

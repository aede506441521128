"""``python -m srs_opt.simulate``: run a gait on the dynamic model."""

from __future__ import annotations

import argparse
import math
import sys
from typing import TYPE_CHECKING

from srs_opt.command import (
    Answer,
    Parser,
    chosen_model,
    finite_float,
    make_parser,
    positive_float,
    run_command,
)

if TYPE_CHECKING:
    import numpy as np

    from srs_opt.robot import Robot


def build_parser() -> Parser:
    """Return the command's options."""
    parser = make_parser(
        "python -m srs_opt.simulate",
        "Run a gait from rest on the dynamic model; writes trajectory.csv and a picture.",
        "python -m srs_opt.simulate --frequency 2 --pressure 55 --offset 0.4 --duration 20",
    )
    add = parser.add_argument
    add("--frequency", type=positive_float, default=2.0, metavar="HZ", help="cycles per second (default 2)")
    add("--pressure", type=positive_float, default=55.0, metavar="KPA", help="regulator, kPa (default 55)")
    add(
        "--offset",
        type=finite_float,
        default=0.0,
        metavar="PHI",
        help="steering offset, -1..1, + left (default 0)",
    )
    add(
        "--phase-lag",
        type=finite_float,
        metavar="RAD",
        help="delay between segments, rad (default 2 pi/(N-1))",
    )
    add("--gait", metavar="FILE", help="gait of gait_opt (JSON), TABLE.json:NAME, or a schedule CSV, instead")
    add(
        "--valves",
        metavar="FILE",
        help="play the valves.csv of a manoeuvre once, from rest or out of the steady --gait, instead",
    )
    add("--duration", type=positive_float, default=20.0, metavar="S", help="simulated time, s (default 20)")
    add(
        "--heading",
        type=finite_float,
        default=0.0,
        metavar="RAD",
        help="heading at the start, rad (default 0)",
    )
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Simulate and write the files."""
    from srs_opt.figures import save_figure
    from srs_opt.gait import Wave
    from srs_opt.gait_file import load_gait
    from srs_opt.robot import load_robot
    from srs_opt.simulate.export import write_trajectory
    from srs_opt.simulate.run import simulate, simulate_valves
    from srs_opt.simulate.valve_file import read_valves

    robot = load_robot(options.robot)
    model = chosen_model(options, robot)
    if options.valves:
        timeline = read_valves(options.valves, robot.segments)
        result = simulate_valves(robot, timeline, model, _in_gait(options, robot, model))
    elif options.gait:
        gait = load_gait(options.gait, options.pressure)
        result = simulate(robot, gait, options.duration, model, options.heading)
    else:
        lag = 2 * math.pi / robot.segments if options.phase_lag is None else options.phase_lag
        gait = Wave.uniform(robot.segments, options.frequency, options.pressure, lag, options.offset).gait()
        result = simulate(robot, gait, options.duration, model, options.heading)
    files = [write_trajectory(result.trajectory, options.out / "trajectory.csv")]
    files += save_figure(result.figure(), options.out / "trajectory")
    return Answer(result.to_dict(), result.in_words(), files=tuple(files))


def _in_gait(options: argparse.Namespace, robot: Robot, model: str) -> np.ndarray | None:
    """Return the state in the steady gait of --gait, travelling along x; None without one."""
    from srs_opt.gait_file import load_gait
    from srs_opt.orbit.steady import travelling

    if not options.gait:
        return None
    return travelling(robot, load_gait(options.gait, options.pressure), model)


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    sys.exit(main())

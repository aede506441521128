"""``python -m planners.motion``: make the motion table that comes with the package."""

from __future__ import annotations

import argparse
from pathlib import Path

from srs_opt.command import Answer, Parser, make_parser, progress, run_command, say


def build_parser() -> Parser:
    """Return the command's parser."""
    parser = make_parser(
        "python -m planners.motion",
        "Simulate what every gait of the built-in robot's table does after every other, for the planner.\n"
        "Other robots' tables are made and cached by `plan` itself.",
        "python -m planners.motion --out planners/motion/shipped",
        robot=False,
    )
    parser.add_argument("--gaits", type=Path, metavar="FILE", help="gait table (default: the shipped one)")
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Simulate and write."""
    from planners.motion.store import table_key, write_transitions
    from planners.motion.transitions import simulate_transitions
    from srs_opt.gait_opt.catalogue import default_table
    from srs_opt.gait_opt.table import load_table
    from srs_opt.robot import wpi_srs

    robot = wpi_srs()
    table = load_table(options.gaits, robot).for_planning() if options.gaits else default_table(robot)
    say(options, f"{len(table.gaits)} gaits of '{table.robot_name}'")
    transitions = simulate_transitions(
        robot, table, progress=lambda rows: progress(rows, options, "gaits before")
    )
    path = write_transitions(options.out / f"{table_key(robot, table)}.npz", transitions)
    size = path.stat().st_size
    record = {"file": str(path), "gaits": len(table.gaits), "bytes": size}
    return Answer(record, f"{path}: {size / 1e6:.1f} MB", files=(path,))


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    raise SystemExit(main())

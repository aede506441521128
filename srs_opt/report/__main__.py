"""``python -m srs_opt.report DATASET``: one page that says what every trial showed."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from srs_opt.command import (
    Answer,
    Parser,
    make_parser,
    one_thread_of_linear_algebra,
    run_command,
    say,
)


def build_parser() -> Parser:
    """Return the command's parser."""
    parser = make_parser(
        "python -m srs_opt.report",
        "Write one HTML page about a data set: per trial what was seen, which markers were lost, residuals\n"
        "of shape, gait and model, the motion with 95 % intervals, every warning. Pictures are part of it.\n"
        "Model residuals are those of the robot file as it stands; --robot takes another.\n"
        "JSON: per trial the numbers of the page (m, s, rad, Hz, kPa).",
        "python -m srs_opt.report data/my_set --out out/page",
        robot=False,
    )
    parser.add_argument("dataset", type=Path, metavar="DATASET", help="folder of the data set")
    parser.add_argument("--robot", type=Path, metavar="FILE", help="robot file to hold against the tracks")
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Look at every trial and write the page."""
    from srs_opt.errors import InputError
    from srs_opt.measurement.read import read_folder
    from srs_opt.problem import Report
    from srs_opt.report.page import write_page
    from srs_opt.report.seen import look
    from srs_opt.robot import load_robot

    report = Report(options.dataset)
    dataset = read_folder(options.dataset, report)
    problems = report.ordered()
    errors = [p for p in problems if p.severity == "error"]
    if errors or dataset is None:
        raise InputError(f"{options.dataset}/{errors[0]} (and {len(errors) - 1} more)")
    robot = load_robot(options.robot) if options.robot else dataset.robot
    found = look(dataset, robot, problems, lambda message: say(options, message))
    path = write_page(dataset, robot, found, problems, options.out / "report.html")
    warned = sum(len(s.warnings) for s in found)
    summary = f"{dataset.name}: {len(found)} trials, {warned} warning(s) about them"
    return Answer({"dataset": dataset.name, "trials": [s.record() for s in found]}, summary, files=(path,))


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit status."""
    one_thread_of_linear_algebra()
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    sys.exit(main())

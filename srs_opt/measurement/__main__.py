"""``python -m srs_opt.measurement DATASET``: what a data set holds, and every problem it has."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from srs_opt.command import Answer, Parser, make_parser, run_command, say

if TYPE_CHECKING:
    from srs_opt.measurement.records import DataSet


def build_parser() -> Parser:
    """Return the command's parser."""
    parser = make_parser(
        "python -m srs_opt.measurement",
        "Check a measured data set and say what it holds: every problem with file and line.\n"
        "Units: m, s, kPa, Hz, rad. Exit status 2 when the set has errors (warnings alone: 0).",
        "python -m srs_opt.measurement data/my_set --json",
        robot=False,
    )
    parser.add_argument(
        "--analyse",
        action="store_true",
        help="also measure: motion per trial with intervals, map, friction, actuator, tow; written to --out",
    )
    parser.add_argument(
        "--steps",
        action="store_true",
        help="make DATASET/bench/steps.csv from the trials of kind step (floor 'lifted' or not)",
    )
    parser.add_argument("dataset", type=Path, metavar="DATASET", help="folder with dataset.yaml")
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Check the data set; raise when it has errors, after listing all of them."""
    from srs_opt.errors import InputError
    from srs_opt.measurement.read import read_folder
    from srs_opt.problem import Report

    report = Report(options.dataset)
    dataset = read_folder(options.dataset, report)
    listed = report.ordered()
    for problem in listed:
        say(options, f"{problem.severity}: {options.dataset}/{problem}")
    errors = [p for p in listed if p.severity == "error"]
    if errors or dataset is None:
        if options.json:
            _print_json(listed)
        raise InputError(f"{options.dataset}: {len(errors)} error(s), first: {errors[0]}")
    files: tuple[Path, ...] = ()
    if options.steps:
        dataset, files = _with_steps(dataset, options)
    bench = dataset.bench
    record = {
        "name": dataset.name,
        "trials": len(dataset.trials),
        "samples": sum(len(t.time_s) for t in dataset.trials),
        "lost_fraction": _mean([t.lost_fraction for t in dataset.trials]),
        "maps": len(dataset.maps),
        "bench": {"steps": len(bench.steps), "spring_car": len(bench.spring_car), "tow": len(bench.tow)},
        "checks": len(bench.checks),
        "problems": [_record(p) for p in listed],
    }
    summary = (
        f"{dataset.name}: {record['trials']} trials, {record['samples']} samples, {record['maps']} map rows, "
        f"{len(bench.steps)} steps, {len(bench.spring_car)} spring-car pulls, {len(bench.tow)} tows; "
        f"{len(listed)} warning(s)"
    )
    if not options.analyse:
        return Answer(record, summary, files=files)
    from srs_opt.measurement.analyse import analyse, describe, write_analysis

    analysis = analyse(dataset)
    files = (*files, *write_analysis(dataset, analysis, options.out))
    return Answer({**record, "analysis": analysis}, f"{summary}\n{describe(analysis)}", files=files)


def _with_steps(dataset: DataSet, options: argparse.Namespace) -> tuple[DataSet, tuple[Path, ...]]:
    """Return the data set with step tests made from its trials, which are written beside them."""
    from dataclasses import replace

    from srs_opt.errors import InputError
    from srs_opt.measurement.dataset import write_steps
    from srs_opt.measurement.take_steps import steps_of

    path = options.dataset / "bench" / "steps.csv"
    if path.exists():
        raise InputError(f"{path}: already exists; move it away first")
    steps, notes = steps_of(dataset)
    for note in notes:
        say(options, f"warning: {note}")
    return replace(dataset, bench=replace(dataset.bench, steps=steps)), (write_steps(steps, path),)


def _mean(values: list[float]) -> float | None:
    return sum(values) / len(values) if values else None


def _record(problem: object) -> dict[str, object]:
    import dataclasses

    return dataclasses.asdict(problem)  # type: ignore[call-overload, no-any-return]


def _print_json(listed: list[object] | list) -> None:  # type: ignore[type-arg]
    import json

    print(json.dumps({"problems": [_record(p) for p in listed]}))


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit status."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    sys.exit(main())

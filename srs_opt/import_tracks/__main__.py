"""``python -m srs_opt.import_tracks FILE... --trials FILE``: recordings become a data set."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from srs_opt.command import Answer, Parser, finite_float, make_parser, positive_float, run_command, say

if TYPE_CHECKING:
    from srs_opt.measurement.importing import TrialNote


def build_parser() -> Parser:
    """Return the command's parser."""
    parser = make_parser(
        "python -m srs_opt.import_tracks",
        "Import recordings of OptiTrack Motive (CSV), Vicon (CSV), Qualisys (TSV), TRC, C3D, DeepLabCut\n"
        "(CSV, HDF5), or any table of positions: markers are found, ordered tail to head, put on the\n"
        "valves' clock and written as a data set. Labels may be unordered, swap, or be missing.\n"
        "Whatever had to be guessed is said.\n"
        "Columns of the list of trials: trial, frequency_hz, pressure_kpa, offset, phase_lag_rad; optional\n"
        "take (a file's or take's name; default: the trial's), valve_start_s (on the take's clock),\n"
        "schedule (a CSV of switch times beside the list), duration_s, tether, floor, replicate_of, kind.",
        "python -m srs_opt.import_tracks takes/*.csv --trials trials.csv --robot robot.yaml --out mine",
    )
    parser.add_argument("takes", type=Path, nargs="+", metavar="FILE", help="recordings")
    parser.add_argument("--trials", type=Path, required=True, metavar="FILE", help="list of trials (CSV)")
    parser.add_argument("--name", help="name of the data set (default: the output folder's)")
    parser.add_argument("--head-marker", metavar="LABEL", help="head's marker (default: told by the bends)")
    parser.add_argument(
        "--markers",
        default="links",
        metavar="WHERE",
        help="where they sit, tail to head: links (default), chamber_ends, chamber_middles, or a YAML list",
    )
    parser.add_argument("--format", default="auto", metavar="NAME", help="files' format (default: found)")
    parser.add_argument("--columns", type=Path, metavar="MAP.yaml", help="which column of a table is what")
    parser.add_argument("--rate", type=positive_float, metavar="HZ", help="frames per second, where not told")
    parser.add_argument(
        "--scale", type=positive_float, metavar="M", help="metres per unit of the positions (per pixel)"
    )
    parser.add_argument(
        "--least-likelihood",
        type=finite_float,
        default=0.6,
        metavar="P",
        help="positions that an estimator is less sure of are lost (default 0.6)",
    )
    parser.add_argument(
        "--up",
        default="auto",
        metavar="AXIS",
        help="up in the system's axes: auto, x, y, z, --up=-y, ... (default auto)",
    )
    parser.add_argument(
        "--points",
        choices=("auto", "markers", "bodies"),
        default="auto",
        help="follow markers or rigid bodies",
    )
    parser.add_argument(
        "--valve-start",
        type=finite_float,
        metavar="S",
        help="valves' start on the take's clock, s (default: found)",
    )
    parser.add_argument(
        "--marker-sd", type=positive_float, metavar="M", help="noise per coordinate, m (default: estimated)"
    )
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Import, write, check what was written."""
    from srs_opt.errors import InputError
    from srs_opt.measurement.dataset import write_dataset
    from srs_opt.measurement.importing import ImportOptions, import_takes, read_schedules, read_trial_list
    from srs_opt.measurement.spots import load_spots
    from srs_opt.measurement.takes.columns import load_columns
    from srs_opt.measurement.takes.formats import read_take
    from srs_opt.measurement.takes.take import ReadSettings
    from srs_opt.measurement.validate import problems
    from srs_opt.robot import load_robot

    if (options.out / "dataset.yaml").exists():
        raise InputError(f"{options.out}: already holds a data set; choose another folder with --out")
    robot = load_robot(options.robot)
    rows = read_trial_list(options.trials)
    schedules = read_schedules(options.trials.parent, rows, robot)
    reading = ReadSettings(
        rate_hz=options.rate,
        scale_m=options.scale,
        least_likelihood=options.least_likelihood,
        columns=load_columns(options.columns) if options.columns else None,
    )
    takes = [read_take(path, reading, options.format) for path in options.takes]
    settings = ImportOptions(
        head_marker=options.head_marker,
        up=options.up,
        points=options.points,
        valve_start_s=options.valve_start,
        marker_sd_m=options.marker_sd,
        spots=load_spots(options.markers, robot.links),
    )
    name = options.name or options.out.resolve().name
    dataset, notes = import_takes(takes, rows, robot, name, settings, schedules)
    write_dataset(dataset, options.out)
    for note in notes:
        for warning in note.warnings:
            say(options, f"warning: trial '{note.trial}': {warning}")
    listed = problems(options.out)
    for problem in listed:
        say(options, f"{problem.severity}: {options.out}/{problem}")
    errors = [p for p in listed if p.severity == "error"]
    record = {
        "dataset": str(options.out),
        "marker_sd_m": dataset.marker_sd_m,
        "trials": [
            {
                "trial": note.trial,
                "take": note.take,
                "valve_start_s": note.valve_start_s,
                "valve_start_sd_s": note.valve_start_sd_s,
                "lost_fraction": note.lost_fraction,
                "ghosts": note.ghosts,
                "begins_moving": note.moving,
                "warnings": list(note.warnings),
            }
            for note in notes
        ],
        "errors": len(errors),
    }
    lines = [
        f"  {n.trial}: valves start at {n.valve_start_s:.4f} s of take '{n.take}'"
        + (f" (sd {n.valve_start_sd_s:.4f} s, found from the {_seen_in(n)})" if n.valve_start_sd_s else "")
        + f", {100 * n.lost_fraction:.1f} % lost, {n.ghosts} ghosts"
        for n in notes
    ]
    summary = "\n".join([f"{len(notes)} trials imported, noise {1e3 * dataset.marker_sd_m:.2f} mm", *lines])
    return Answer(record, summary, good=not errors, files=(options.out / "dataset.yaml",))


def _seen_in(note: TrialNote) -> str:
    return "phase of the bends, after a run-in before the take" if note.moving else "first motion"


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit status."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    sys.exit(main())

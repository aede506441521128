"""Command: fit the robot's parameters to a measured data set."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from srs_opt.calibrate.data_settings import MAP_DATA
from srs_opt.calibrate.fit_settings import CALIBRATION_REPORT
from srs_opt.command import (
    Answer,
    Parser,
    add_model,
    make_parser,
    one_thread_of_linear_algebra,
    run_command,
    say,
)

if TYPE_CHECKING:
    from srs_opt.calibrate.result import Calibration


def build_parser() -> Parser:
    """Return the command's parser."""
    parser = make_parser(
        "python -m srs_opt.calibrate",
        "Fit friction, curvature per pressure and time constants to all trials of a data set at once, bench\n"
        "values as priors; write robot.yaml with estimates and relative standard deviations.\n"
        "JSON: parameters and sd (SI units, pressure in kPa), unidentifiable (directions the data say\n"
        "nothing about), misfit {before, after} (root mean square over the noise), warnings (values more\n"
        "than three standard deviations from the bench), noise (per coordinate, as the tracks show it; null\n"
        "from maps), set_aside (trials that were not used, and why), data (tracks or maps)\n"
        "and, from maps alone, sd_with_tracks (what tracks of the same gaits would leave; else null).",
        "python -m srs_opt.calibrate data/my_set --json",
        robot=False,
        sweep=True,
    )
    parser.add_argument("dataset", type=Path, metavar="DATASET", help="folder of the data set")
    parser.add_argument(
        "--robot", type=Path, metavar="FILE", help="robot file to start from (default: the data set's own)"
    )
    add_model(parser)
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Calibrate and write robot.yaml."""
    from srs_opt.calibrate.run import calibrate, going_on_from
    from srs_opt.measurement.dataset import load_dataset
    from srs_opt.parallel import executor
    from srs_opt.robot import load_robot, save_robot

    dataset = load_dataset(options.dataset)
    if options.robot is not None:
        dataset = going_on_from(dataset, load_robot(options.robot))
    with executor(options.jobs, options.cluster) as where:
        found = calibrate(dataset, options.model, lambda message: say(options, message), where)
    path = save_robot(found.robot, options.out / "robot.yaml")
    return Answer(found.to_dict(), _summary(found), files=(path,))


def _summary(found: Calibration) -> str:
    lines = [f"{name:34s} {value:.6g} +- {found.sd[name]:.2g}" for name, value in found.parameters.items()]
    lines.append(f"misfit over noise: {found.before:.3f} -> {found.after:.3f}")
    if found.unidentifiable:
        lines.append("the data say nothing about: " + "; ".join(found.unidentifiable))
    lines += [f"warning: {text}" for text in found.warnings]
    if found.noise is not None:
        lines.append(f"noise per coordinate: {found.noise.in_words}")
    lines += [f"trial {name} set aside: {why}" for name, why in found.set_aside.items()]
    if found.sd_with_tracks is not None:
        track = f"{MAP_DATA.track_s:g} s of track"
        lines.append(f"from maps alone; {track} of every gait would know better by the factor")
        less = {n: sd / found.sd_with_tracks[n] for n, sd in found.sd.items()}
        lines.append(", ".join(f"{name} {factor:.2g}" for name, factor in less.items()))
    if found.robot.friction_normal < found.robot.friction_tangential:
        lines.append("friction across is below friction along: not so with wheels; are head and tail right?")
    if found.after > CALIBRATION_REPORT.unexplained_misfit:
        lines.append("the model does not explain the data: see python -m srs_opt.discrepancy")
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit status."""
    one_thread_of_linear_algebra()
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    sys.exit(main())

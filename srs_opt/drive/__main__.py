"""``python -m srs_opt.drive``: which gait moves the robot as wanted?"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from srs_opt.command import Answer, Parser, chosen_model, finite_float, make_parser, run_command, say

if TYPE_CHECKING:
    from srs_opt.drive.calibration import DriveCalibration
    from srs_opt.drive.drive import DriveGait

_DEFAULT_LAGS = (0.9, 1.2, math.pi / 2)


def build_parser() -> Parser:
    """Return the command's options."""
    parser = make_parser(
        "python -m srs_opt.drive",
        "Find the gait for a wanted speed and radius (or turn rate), forward or backwards.",
        "python -m srs_opt.drive --speed 0.2 --radius 0.3",
        sweep=True,
    )
    add = parser.add_argument
    add(
        "--speed",
        type=finite_float,
        required=True,
        metavar="M_S",
        help="wanted speed, m/s; negative: backwards",
    )
    add(
        "--radius",
        type=finite_float,
        metavar="M",
        help="wanted radius, m, + centre on the left (default: straight)",
    )
    add("--turn-rate", type=finite_float, metavar="RAD_S", help="wanted turn rate instead, rad/s, + left")
    add("--map", type=Path, metavar="FILE", help="map.csv of gait_map (default: one is computed)")
    add("--measured", type=Path, metavar="FILE", help="measured maps.csv that corrects the simulated map")
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Build the drive, ask it, write the gait."""
    import numpy as np

    from srs_opt.drive.calibration import NO_CALIBRATION, save_calibration
    from srs_opt.drive.drive import drive_from_map
    from srs_opt.drive.figures import reachable_figure
    from srs_opt.drive.fit import calibrate_drive, load_measured_map
    from srs_opt.errors import InputError
    from srs_opt.figures import save_figure
    from srs_opt.files import write_json
    from srs_opt.gait_map.grid import grid_points, load_map, map_at, save_map
    from srs_opt.robot import load_robot

    if options.radius is not None and options.turn_rate is not None:
        raise InputError("give --radius or --turn-rate, not both")
    robot = load_robot(options.robot)
    model = chosen_model(options, robot)
    files = []
    if options.map:
        gaits = load_map(options.map)
    else:
        points = grid_points(
            list(np.linspace(1, 2, 5)), (41.0, 48.0, 55.0), list(np.linspace(0, 0.8, 6)), _DEFAULT_LAGS
        )
        gaits = map_at(robot, model, points, jobs=options.jobs, cluster=options.cluster, quiet=options.quiet)
        files.append(save_map(gaits, options.out / "map.csv"))
    calibration = NO_CALIBRATION
    if options.measured:
        calibration = calibrate_drive(robot, load_measured_map(options.measured), model)
        files.append(save_calibration(calibration, options.out / "drive.json"))
        say(options, calibration_words(calibration, robot.pitch_m / robot.segment_length_m))
    drive = drive_from_map(robot, gaits, calibration, model)
    turn_rate = options.turn_rate or 0.0
    if options.radius is not None:
        chosen = drive.gait_for_radius(options.speed, options.radius)
    else:
        chosen = drive.gait_for(options.speed, turn_rate)
    record = gait_record(chosen, calibration)
    files += [
        write_json(options.out / "gait.json", record),
        *save_figure(reachable_figure(drive, chosen), options.out / "reachable"),
    ]
    return Answer(record, _words(chosen), files=tuple(files))


def gait_record(chosen: DriveGait, calibration: DriveCalibration) -> dict[str, Any]:
    """Return the JSON of a chosen gait; `simulate --gait` reads it."""
    from dataclasses import asdict

    switches = [
        {"segment": i, "on_s": on, "off_s": off}
        for i, pairs in enumerate(chosen.gait.intervals, start=1)
        for on, off in pairs
    ]
    radius = chosen.speed_m_s / chosen.turn_rate_rad_s if chosen.orbit.radius_m is not None else None
    return {
        "speed_m_s": chosen.speed_m_s,
        "speed_sd_m_s": chosen.speed_sd_m_s,
        "turn_rate_rad_s": chosen.turn_rate_rad_s,
        "turn_rate_sd_rad_s": chosen.turn_rate_sd_rad_s,
        "radius_m": radius,
        "envelope_m": list(chosen.orbit.envelope_m),
        "reverse": chosen.reverse,
        "frequency_hz": chosen.wave.frequency_hz,
        "pressure_kpa": chosen.wave.pressure_kpa,
        "phase_rad": list(chosen.wave.phase_rad),
        "offset": list(chosen.wave.offset),
        "switches": switches,
        "calibration": asdict(calibration),
    }


def calibration_words(calibration: DriveCalibration, paper_factor: float) -> str:
    """Say what the measured map changed."""
    parts = []
    for name, factor in (("speed", calibration.speed), ("radius", calibration.radius)):
        if factor.gaits:
            parts.append(
                f"{name} x {factor.value:.3f} +- {factor.sd:.3f} (scatter {100 * factor.scatter_sd:.1f} %, "
                f"{factor.gaits} gaits)"
            )
    return f"measured map: {', '.join(parts)}; the paper's (l + L_o)/l would be {paper_factor:.3f}"


def _words(chosen: DriveGait) -> str:
    wave = chosen.wave
    direction = "reversed wave" if chosen.reverse else "forward wave"
    return (
        f"{direction}: {wave.frequency_hz:.3f} Hz, {wave.pressure_kpa:.1f} kPa, lag "
        f"{wave.phase_rad[1] - wave.phase_rad[0]:.3f} rad, offset {wave.offset[0]:+.3f} -> "
        f"{chosen.speed_m_s:.4f} m/s, {chosen.turn_rate_rad_s:+.4f} rad/s, envelope "
        f"{chosen.orbit.envelope_m[0]:.3f} m right, {chosen.orbit.envelope_m[1]:.3f} m left"
    )


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    sys.exit(main())

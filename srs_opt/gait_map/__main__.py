"""``python -m srs_opt.gait_map``: speed and radius over frequency, pressure, offset and lag."""

from __future__ import annotations

import argparse
import math
import shutil
import sys
import time
from typing import Any

from srs_opt.command import Answer, Parser, chosen_model, finite_float, make_parser, run_command, say


def build_parser() -> Parser:
    """Return the command's options."""
    parser = make_parser(
        "python -m srs_opt.gait_map",
        "Map speed, turn rate, radius and envelope of steady gaits; writes map.csv and contour pictures.",
        "python -m srs_opt.gait_map --frequency 1 2 11 --pressure 41 55 8 --offset 0 0.4",
        sweep=True,
    )
    add = parser.add_argument
    for name, default, unit in (("frequency", (1.0, 2.0, 11), "Hz"), ("pressure", (41.0, 55.0, 8), "kPa")):
        shown = " ".join(f"{v:g}" for v in default)
        add(f"--{name}", nargs=3, type=finite_float, metavar=("LO", "HI", "N"), default=default,
            help=f"{unit}, from, to, how many (default {shown})")  # fmt: skip
    add("--offset", nargs="+", type=finite_float, default=[0.0, 0.4], metavar="PHI", help="steering offsets")
    add("--phase-lag", nargs="+", type=finite_float, metavar="RAD", help="delays between segments, rad")
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Compute the map and write the files."""
    import numpy as np

    from srs_opt.figures import save_figure
    from srs_opt.gait_map.figures import map_figures
    from srs_opt.gait_map.grid import grid_points, map_at, save_map
    from srs_opt.model.parameters import room_effects
    from srs_opt.robot import load_robot

    robot = load_robot(options.robot)
    model = chosen_model(options, robot)
    left_out = room_effects(robot)
    if left_out:
        say(
            options,
            f"note: {', '.join(left_out)} left out of the map: they depend on the place, no gait is steady",
        )
    lags = options.phase_lag or [2 * math.pi / robot.segments]
    points = grid_points(_span("--frequency", options.frequency), _span("--pressure", options.pressure),
                         options.offset, lags)  # fmt: skip
    started = time.perf_counter()
    unfinished = options.out / "map.unfinished"  # an interrupted map goes on from here
    gaits = map_at(
        robot, model, points,
        jobs=options.jobs, cluster=options.cluster, quiet=options.quiet, resume=unfinished,
    )  # fmt: skip
    seconds = time.perf_counter() - started
    files = [save_map(gaits, options.out / "map.csv")]
    for name, sheet in map_figures(gaits).items():
        files += save_figure(sheet, options.out / name)
    shutil.rmtree(unfinished, ignore_errors=True)
    speed, radius = np.abs(gaits.column("speed_m_s")), np.abs(gaits.column("radius_m"))
    record: dict[str, Any] = {
        "points": len(points),
        "seconds": seconds,
        "speed_max_m_s": float(np.nanmax(speed)) if np.isfinite(speed).any() else None,
        "radius_min_m": float(np.nanmin(radius)) if np.isfinite(radius).any() else None,
        "without_steady_gait": int(np.isnan(speed).sum()),
        "effects_left_out": left_out,
    }
    words = f"{len(points)} gaits in {seconds:.1f} s; fastest {_unit(record['speed_max_m_s'], 'm/s')}"
    words += f", tightest radius {_unit(record['radius_min_m'], 'm')}"
    if record["without_steady_gait"]:
        words += f"; {record['without_steady_gait']} gaits have no steady state (empty rows)"
    return Answer(record, words, good=bool(np.isfinite(speed).any()), files=tuple(files))


def _unit(value: float | None, unit: str) -> str:
    return "none" if value is None else f"{value:.3f} {unit}"


def _span(option: str, values: tuple[float, float, float]) -> list[float]:
    import numpy as np

    from srs_opt.errors import InputError

    low, high, count = values
    if not 0 < low <= high:
        raise InputError(f"{option} {low:g} {high:g}: expected 0 < LO <= HI")
    if count != int(count) or not 1 <= count <= 10_000:
        raise InputError(f"{option}: N must be a whole number from 1 to 10000, found {count:g}")
    return [float(v) for v in np.linspace(low, high, int(count))]


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    sys.exit(main())

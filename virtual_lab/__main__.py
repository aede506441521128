"""Command: write a measured data set in which effects are hidden."""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import os
import sys
import time
from pathlib import Path

from virtual_lab.command_line import Parser
from virtual_lab.errors import LabError

PROG = "python -m virtual_lab"
# sizes beyond which nothing snake-like is left to simulate, or a data set fills the computer
MOST = {
    "scale": 20.0,
    "bench_error": 5.0,
    "duration": 600.0,
    "rate": 1e4,
    "noise": 1.0,
    "stated_noise": 1.0,
    "correlated_noise": 1.0,
    "correlation": 600.0,
    "drift": 1.0,
    "systematic": 1.0,
}


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or value < 0:
        raise argparse.ArgumentTypeError(f"expected a number not below 0, found '{text}'")
    return value


def build_parser() -> argparse.ArgumentParser:
    """Return the command's parser."""
    parser = Parser(
        prog=PROG,
        description="Write a measured data set from a seed, with effects hidden in it; "
        "what is hidden goes to <DIR>.truth.json beside it.",
        epilog=f"example:\n  {PROG} --effect tether_drag --design small --seed 3 --out out/lab",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add(
        "--effect",
        action="append",
        default=[],
        metavar="NAME",
        help="effect to hide (repeat for several; default none)",
    )
    add("--robot", type=Path, metavar="FILE", help="robot file of the robot in it (default: the WPI SRS)")
    add(
        "--scale",
        type=_number,
        metavar="X",
        help="size over the typical one (default: drawn from 0.7 to 1.4)",
    )
    add(
        "--design",
        default="small",
        choices=("small", "large", "steps"),
        help="12 x 4 s, 33 x 7.9 s, or one step per segment",
    )
    add("--duration", type=_number, metavar="S", help="duration of each trial, s (default: the design's)")
    add(
        "--bench-error",
        type=_number,
        default=1.0,
        metavar="X",
        help="errors of robot.yaml, in its own deviations (default 1)",
    )
    add(
        "--engine",
        default="equations",
        choices=("equations", "dart"),
        help="what moves the body: the laboratory's equations, or a physics engine (extra 'judge'; default "
        "equations)",
    )
    add("--rate", type=_number, default=120.0, metavar="HZ", help="camera rate (default 120)")
    add("--noise", type=_number, default=0.001, metavar="M", help="noise per coordinate, m (default 0.001)")
    add(
        "--stated-noise",
        type=_number,
        metavar="M",
        help="noise that dataset.yaml claims, m (default: the truth)",
    )
    add("--lost", type=_number, default=0.01, metavar="P", help="share of lost markers (default 0.01)")
    add(
        "--correlated-noise",
        type=_number,
        default=0.0,
        metavar="M",
        help="further noise per coordinate that is correlated in time, m",
    )
    add("--correlation", type=_number, default=0.2, metavar="S", help="its correlation time, s (default 0.2)")
    add("--drift", type=_number, default=0.0, metavar="M", help="how far the picture creeps in a trial, m")
    add("--outliers", type=_number, default=0.0, metavar="P", help="share of positions that are elsewhere")
    add("--swaps", type=_number, default=0.0, metavar="P", help="share of frames with two labels exchanged")
    add(
        "--systematic",
        type=_number,
        default=0.0,
        metavar="M",
        help="smooth error that repeats with the gait, root mean square, m",
    )
    add(
        "--wrong-entry",
        default="",
        metavar="KIND",
        help="one trial is not what trials.csv says: phase_sign, frequency or other_robot",
    )
    add("--no-scatter", action="store_true", help="friction and curvature do not scatter from trial to trial")
    add("--centre-of-mass", action="store_true", help="tracks of the centre of mass alone")
    add("--bench", action="store_true", help="also bench/: steps, spring car, tow, checks")
    add("--maps", action="store_true", help="also maps.csv")
    add("--maps-only", action="store_true", help="maps.csv in place of tracks")
    add("--list", action="store_true", help="list the effects and their typical sizes")
    add("--seed", type=int, default=0, metavar="N", help="seed of all randomness (default 0)")
    add(
        "--out",
        type=Path,
        metavar="DIR",
        default=Path("out/virtual_lab"),
        help="the data set's folder (default out/virtual_lab)",
    )
    add("--json", action="store_true", help="print one JSON object on stdout and nothing else there")
    add("--quiet", action="store_true", help="no messages")
    return parser


def _list(options: argparse.Namespace) -> None:
    from virtual_lab.catalogue import ENGINE_KINDS, KINDS

    table = {
        k.name: {"typical": k.typical, "parameters": k.parameters, "listed": k.listed}
        for k in (*KINDS.values(), *ENGINE_KINDS.values())
    }
    if options.json:
        print(json.dumps(table))
        return
    for name, row in table.items():
        mark = "" if row["listed"] else "  (in no list)"
        print(f"{name:24s} {' '.join(row['parameters']):40s} typical {row['typical']:g}{mark}")  # type: ignore[arg-type]


def make(options: argparse.Namespace) -> dict[str, object]:
    """Write the data set that the options ask for; return what was written."""
    import numpy as np

    from virtual_lab.dataset import Recording, truth_file, write_dataset
    from virtual_lab.draw import draw_truth
    from virtual_lab.robot_file import WPI_SRS, read_robot
    from virtual_lab.trials import design
    from virtual_lab.truth import Scatter

    for name, most in MOST.items():
        value = getattr(options, name)
        if value is not None and value > most:
            raise LabError(f"--{name.replace('_', '-')}: expected at most {most:g}, found {value:g}")
    if options.seed < 0:
        raise LabError(f"--seed must not be below 0, found {options.seed}")
    start = time.perf_counter()
    truth = draw_truth(
        options.effect,
        np.random.default_rng([options.seed, 4]),
        (options.scale, options.scale) if options.scale is not None else (0.7, 1.4),
        robot=read_robot(options.robot) if options.robot is not None else WPI_SRS,
        bench_error=options.bench_error,
        scatter=Scatter(0.0, 0.0, 0.0) if options.no_scatter else Scatter(),
    )
    truth = dataclasses.replace(truth, engine=options.engine)
    trials = design(
        options.design, np.random.default_rng([options.seed, 5]), truth.parameters.links, options.duration
    )
    recording = Recording(
        rate_hz=options.rate,
        marker_sd_m=options.noise,
        stated_sd_m=options.stated_noise,
        lost=options.lost,
        markers="centre_of_mass" if options.centre_of_mass else "tail_to_head",
        bench=options.bench,
        maps=options.maps or options.maps_only,
        tracks=not options.maps_only,
        correlated_sd_m=options.correlated_noise,
        correlation_s=options.correlation,
        drift_m=options.drift,
        outlier_share=options.outliers,
        swap_share=options.swaps,
        systematic_sd_m=options.systematic,
        wrong_entry=options.wrong_entry,
    )
    documented = truth.documented["effects"]
    folder = write_dataset(options.out, truth, trials, options.seed, recording)
    return {
        "dataset": str(folder),
        "truth": str(truth_file(folder)),
        "trials": len(trials),
        "hidden": [e["name"] for e in (*truth.effects, *truth.unlisted) if e not in documented],
        "seconds": round(time.perf_counter() - start, 3),
    }


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit status (0 done, 2 bad input)."""
    options = build_parser().parse_args(argv)
    try:
        if options.list:
            _list(options)
            if sys.stdout is not None:
                sys.stdout.flush()
            return 0
        answer = make(options)
        if options.json:
            print(json.dumps(answer))
        elif not options.quiet:
            print(f"{answer['trials']} trials in {answer['seconds']} s")
            print(f"  wrote {answer['dataset']}\n  wrote {answer['truth']}")
        if sys.stdout is not None:  # closed by whoever started this
            sys.stdout.flush()
    except LabError as error:
        print(f"{PROG}: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except ModuleNotFoundError as error:
        print(f"{PROG}: needs {error.name}; install the project with its dev extra", file=sys.stderr)
        return 2
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except OSError as error:
        print(f"{PROG}: {error.filename or 'output'}: {error.strerror or error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"\n{PROG}: interrupted; no incomplete file was left behind", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Do the calibration's intervals cover the truth at their stated rate?

    python -m benchmarks.calibrate_coverage --sets 200 --jobs 2

Small sets from the virtual laboratory, nothing hidden; its friction is smoothed more finely than the model's,
friction and curvature scatter from trial to trial, bench values are off and the noise is misstated. Per
parameter: how often the 90 % interval holds the true value, with the 99 % Clopper-Pearson interval of that
rate; fails (exit status 1) where the latter excludes 90 %. Also mean and spread of (estimate - truth)/sd,
which should be 0 and 1, and by how much the fit narrows the bench's deviation.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.intervals import interval, rate
from benchmarks.section import Section

LEVEL, WIDTH = 0.90, 1.6449
TRIALS, SECONDS = 8, 3.0
COLUMNS = ("parameter", "90 % interval holds the truth", "99 % interval of that rate", "90 % inside")
Row = dict[str, tuple[float, float]]


def pulls(seed: int) -> Row:
    """Return (estimate - truth)/sd and sd over the bench's sd, per parameter, for one generated set."""
    from srs_opt.calibrate.coordinates import ASSUMED_SD
    from srs_opt.calibrate.run import calibrate
    from srs_opt.measurement.dataset import load_dataset
    from virtual_lab.dataset import Recording, write_dataset
    from virtual_lab.draw import draw_truth
    from virtual_lab.trials import small_design

    rng = np.random.default_rng([seed, 4])
    truth = draw_truth((), rng)
    stated = 0.001 * float(rng.choice([0.5, 1.0, 2.0]))
    design = small_design(np.random.default_rng([seed, 5]), SECONDS)[:TRIALS]
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "set"
        write_dataset(folder, truth, design, seed, Recording(stated_sd_m=stated))
        dataset = load_dataset(folder)
        found = calibrate(dataset)
    bench = {**ASSUMED_SD, **dataset.robot.relative_sd}
    return {
        name: (
            (value - getattr(truth.parameters, name)) / found.sd[name],
            found.sd[name] / (bench[name] * getattr(dataset.robot, name)),
        )
        for name, value in found.parameters.items()
    }


def study(sets: int, seed: int, jobs: int) -> list[Row]:
    """Return the pulls of `sets` generated sets."""
    from joblib import Parallel, delayed

    return list(Parallel(n_jobs=jobs)(delayed(pulls)(10_000 * seed + k) for k in range(sets)))


def table(rows: Sequence[Row]) -> tuple[list[list[str]], bool]:
    """Return the report's table, and whether every parameter's rate agrees with LEVEL."""
    lines, good = [], True
    for name in rows[0]:
        z, narrowed = np.array([row[name] for row in rows]).T
        hits = int(np.sum(np.abs(z) <= WIDTH))
        low, high = interval(hits, len(rows))
        inside = low <= LEVEL <= high
        good &= inside
        spread = f"{z.mean():+.2f} ± {z.std():.2f}"
        lines.append(
            [name, rate(hits, len(rows)), f"{low:.3f} to {high:.3f}", "yes" if inside else "NO"]
            + [spread, f"{np.median(narrowed):.2f}"]
        )
    return lines, good


def run(quick: bool) -> Section:
    """Return the report's section."""
    sets = 4 if quick else 200
    cpu = time.process_time()
    rows = study(sets, 1, 1)
    lines, _ = table(rows)
    return Section(
        "Calibration: do intervals cover the truth?",
        (*COLUMNS, "(estimate - truth)/sd", "sd over the bench's sd"),
        lines,
        [
            f"{sets} generated sets of {TRIALS} trials of {SECONDS:g} s, nothing hidden, bench values off, "
            f"noise misstated by up to a factor 2; {(time.process_time() - cpu) / sets:.1f} s of processor "
            "time per set, generating it included."
        ],
    )


def main(argv: list[str] | None = None) -> int:
    """Run the benchmark and print the coverage of every parameter."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--rows", type=Path, help="write every set's pulls to this file, one JSON per line")
    options = parser.parse_args(argv)
    started = time.perf_counter()
    rows = study(options.sets, options.seed, options.jobs)
    if options.rows is not None:
        options.rows.write_text("".join(json.dumps(row) + "\n" for row in rows))
    lines, good = table(rows)
    for name, hits, span, inside, spread, narrowed in lines:
        print(f"{name:34s} {hits}  [{span}]  {inside:3s}  {spread}  {narrowed}")
    print(f"{options.sets} sets, {time.perf_counter() - started:.0f} s on {options.jobs} processes")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())

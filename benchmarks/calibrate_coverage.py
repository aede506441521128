"""Do the calibration's intervals cover the truth at their stated rate?

    python -m benchmarks.calibrate_coverage --sets 200 --jobs 2

Small sets from the virtual laboratory, nothing hidden; its friction is smoothed more finely than the model's,
friction and curvature scatter from trial to trial, bench values are off and the noise is misstated. Per
parameter: how often the 90 % interval holds the true value, with the 99 % Clopper-Pearson interval of that
rate; fails (exit status 1) where the latter excludes 90 %. Also mean and spread of (estimate - truth)/sd,
which should be 0 and 1, and by how much the fit narrows the bench's deviation. ``--camera`` adds what real
cameras add: noise correlated in time, drift, outliers, an error that repeats with the gait.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np

from benchmarks.intervals import interval, rate
from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser

LEVEL, WIDTH = 0.90, 1.6449
TRIALS, SECONDS = 8, 3.0
COLUMNS = ("parameter", "90 % interval holds the truth", "99 % interval of that rate", "90 % inside")
CAMERA = {
    "correlated_sd_m": 3e-4,
    "correlation_s": 0.2,
    "drift_m": 5e-4,
    "outlier_share": 0.005,
    "systematic_sd_m": 1e-4,
}
Row = dict[str, tuple[float, float]]


def camera_pulls(seed: int) -> Row:
    """Return what `pulls` does, of a set as a real camera records it."""
    return pulls(seed, CAMERA)


def pulls(seed: int, camera: Mapping[str, float] = MappingProxyType({})) -> Row:
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
        write_dataset(folder, truth, design, seed, Recording(stated_sd_m=stated, **camera))
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


def seeds(sets: int, seed: int) -> list[tuple[int]]:
    """Return the seed of every set."""
    return [(10_000 * seed + k,) for k in range(sets)]


def run(quick: bool) -> Section:
    """Return the coverage of the stored study; of a few sets, measured now, where there is none or to be
    quick."""
    stored = None if quick else stored_rows("calibrate_coverage")
    if stored is None:
        stored = "now", [pulls(*seed) for seed in seeds(1 if quick else 4, 1)]
    measured, rows = stored
    return Section(
        "Calibration: do intervals cover the truth?",
        (*COLUMNS, "(estimate - truth)/sd", "sd over the bench's sd"),
        table(rows)[0],
        [
            f"{len(rows)} generated sets of {TRIALS} trials of {SECONDS:g} s, nothing hidden, bench values "
            f"off, noise misstated by up to a factor 2. Measured {measured}."
        ],
    )


def main(argv: list[str] | None = None) -> int:
    """Run the study and print the coverage of every parameter."""
    parser = study_parser("calibrate_coverage", __doc__, 200)
    parser.add_argument("--camera", action="store_true", help="noise as real cameras have it")
    options = parser.parse_args(argv)
    if options.camera and options.rows == parser.get_default("rows"):
        options.rows = options.rows.with_name("calibrate_camera.jsonl")
    name, work = ("calibrate_camera", camera_pulls) if options.camera else ("calibrate_coverage", pulls)
    lines, good = table(gather(name, work, seeds(options.sets, options.seed), options))
    for name, hits, span, inside, spread, narrowed in lines:
        print(f"{name:34s} {hits}  [{span}]  {inside:3s}  {spread}  {narrowed}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())

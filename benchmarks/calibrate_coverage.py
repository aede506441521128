"""Do the calibration's intervals cover the truth at their stated rate?

    python -m benchmarks.calibrate_coverage --sets 200 --jobs 2

Small sets from the virtual laboratory, nothing hidden; its friction is smoothed more finely than the model's
and friction and curvature scatter from trial to trial. Prints, per parameter, how often the 90 % interval
holds the true value, with the 99 % Clopper-Pearson interval of that rate; fails (exit status 1) where the
latter excludes 90 %.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.intervals import interval, rate

LEVEL, WIDTH = 0.90, 1.6449
TRIALS, SECONDS = 8, 3.0


def covered(seed: int) -> dict[str, bool]:
    """Return, per parameter, whether the 90 % interval of one generated set holds the truth."""
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
        found = calibrate(load_dataset(folder))
    return {
        name: abs(value - getattr(truth.parameters, name)) <= WIDTH * found.sd[name]
        for name, value in found.parameters.items()
    }


def main(argv: list[str] | None = None) -> int:
    """Run the benchmark and print the coverage of every parameter."""
    from joblib import Parallel, delayed

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sets", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args(argv)
    started = time.perf_counter()
    seeds = [10_000 * options.seed + k for k in range(options.sets)]
    rows = Parallel(n_jobs=options.jobs)(delayed(covered)(seed) for seed in seeds)
    good = True
    for name in rows[0]:
        hits = sum(row[name] for row in rows)
        low, high = interval(hits, len(rows))
        good &= low <= LEVEL <= high
        print(f"{name:34s} {rate(hits, len(rows))}  [{low:.3f}, {high:.3f}]  goal {LEVEL:.2f}")
    print(f"{options.sets} sets, {time.perf_counter() - started:.0f} s on {options.jobs} processes")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())

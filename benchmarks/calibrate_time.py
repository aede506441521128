"""How long a calibration takes: 33 trials of 8 s at 120 Hz, five markers."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.section import Section
from srs_opt.calibrate.run import calibrate
from srs_opt.measurement.dataset import load_dataset
from srs_opt.parallel import executor
from virtual_lab.dataset import write_dataset
from virtual_lab.draw import draw_truth
from virtual_lab.trials import large_design

GOAL_S = 60.0  # on two cores


def run(quick: bool) -> Section:
    rng = np.random.default_rng(7)
    trials = large_design(rng, 2.0 if quick else 8.0)[: 4 if quick else 33]
    with tempfile.TemporaryDirectory() as scratch:
        write_dataset(Path(scratch) / "set", draw_truth((), rng), trials, 7)
        dataset = load_dataset(Path(scratch) / "set")
    calibrate(dataset)  # compiles
    rows = []
    for jobs in (1,) if quick else (1, 2):
        lines: list[str] = []
        wall, cpu = time.perf_counter(), time.process_time()
        with executor(jobs) as where:
            found = calibrate(dataset, report=lines.append, where=where)
        own = time.process_time() - cpu
        took = f"{time.perf_counter() - wall:.1f}"
        rows.append(
            [str(jobs), took, f"{own:.1f}", str(len(lines)), f"{found.before:.1f} → {found.after:.3f}"]
        )
    frames = sum(t.time_s.size for t in dataset.trials)
    return Section(
        "Calibration: time",
        ("processes", "wall (s)", "processor time of the first process (s)", "iterations", "misfit"),
        rows,
        [f"{len(trials)} trials, {frames} frames of five markers; goal {GOAL_S:g} s on two cores."],
    )

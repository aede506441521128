"""Does the recommended experiment tell look-alikes apart?

    python -m benchmarks.discrepancy_ties --sets 24 --jobs 2

Sets in which one of two look-alikes is hidden. Where the answer is `one_of`, the instrument that the answer
recommends is read, nothing else, and the set is examined again: at most two instruments.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.intervals import interval, rate
from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser

HIDDEN = ("dead_time", "clock_offset", "camera_scale", "gap_length")
MOST = 2  # instruments
Row = dict[str, Any]


def record(folder: Path, hidden: str, seed: int, instruments: Sequence[str]) -> None:
    """Write one small set with the readings of `instruments` (quantities of checks.csv), no others."""
    from virtual_lab.dataset import Recording, write_dataset
    from virtual_lab.draw import draw_truth
    from virtual_lab.trials import small_design

    truth = draw_truth((hidden,), np.random.default_rng([seed, 4]))
    trials = small_design(np.random.default_rng([seed, 5]))
    write_dataset(folder, truth, trials, seed, Recording(bench=bool(instruments)))
    for file in (folder / "bench").glob("*.csv"):
        head, *rows = file.read_text(encoding="utf-8").splitlines()
        kept = [row for row in rows if row.split(",")[0] in instruments]
        if file.name == "checks.csv" and kept:
            file.write_text("\n".join([head, *kept]) + "\n", encoding="utf-8")
        else:
            file.unlink()


def examine(hidden: str, seed: int) -> Row:
    """Examine a set, read what is recommended while the answer is `one_of`."""
    from srs_opt.discrepancy.answer import answer
    from srs_opt.discrepancy.pipeline import diagnose
    from srs_opt.measurement.dataset import load_dataset

    said: list[str] = []
    named: list[str] = []
    instruments: list[str] = []
    while len(said) <= MOST:
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch) / "set"
            record(folder, hidden, seed, instruments)
            found = answer(diagnose(load_dataset(folder)), None)
        said.append(found["verdict"])
        named = sorted(e["name"] for e in found["effects"])
        what = found["next_experiment"]["what"] if found["next_experiment"] else ""
        if found["verdict"] != "one_of" or "(" not in what:
            break
        instruments.append(what.rsplit("(", 1)[1].rstrip(")"))
    return {"hidden": hidden, "seed": seed, "said": said, "named": named, "instruments": instruments}


def resolved(row: Row) -> bool:
    """Whether the last answer names what is hidden."""
    return bool(row["said"][-1] == "named" and row["named"] == [row["hidden"]])


def run(quick: bool) -> Section:
    """Return what was measured last, quick or not; one set, measured now, where nothing was."""
    stored = stored_rows("discrepancy_ties")
    if stored is None:
        stored = "now, one set only", [examine("dead_time", 1)]
    measured, rows = stored
    ties = [r for r in rows if r["said"][0] == "one_of"]
    table = []
    for hidden in HIDDEN:
        own = [r for r in ties if r["hidden"] == hidden]
        if own:
            asked = sorted({i for r in own for i in r["instruments"]})
            table.append([hidden, rate(sum(map(resolved, own)), len(own)).strip(), ", ".join(asked)])
    notes = [f"Measured {measured}. {len(ties)} of {len(rows)} sets were ties. Goal: resolved in >= 0.90."]
    if ties:
        hits = sum(map(resolved, ties))
        low, high = interval(hits, len(ties))
        notes.append(f"In all {rate(hits, len(ties)).strip()}, 99 % interval {low:.3f} to {high:.3f}.")
    return Section(
        "Discrepancy: ties resolved by the recommended instrument",
        ["hidden", "ties resolved", "instruments asked for"],
        table,
        notes,
    )


def main(argv: list[str] | None = None) -> int:
    """Run the study and print its table."""
    options = study_parser("discrepancy_ties", __doc__, 24).parse_args(argv)
    items = [(HIDDEN[k % len(HIDDEN)], 1000 * options.seed + k) for k in range(options.sets)]
    for row in gather("discrepancy_ties", examine, items, options):
        print(row)
    print(run(quick=False).markdown())
    return 0


if __name__ == "__main__":
    sys.exit(main())

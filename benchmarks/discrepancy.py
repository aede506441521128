"""How often ``srs_opt.discrepancy`` is right, over sets from a laboratory that shares no code with it.

    python -m benchmarks.discrepancy --sets 300 --jobs 2

Kinds of sets: ``null`` (nothing hidden; bench values off, noise misstated), ``typical`` (one effect at 0.7 to
1.4 times its typical size, place at random), ``third`` (a third of that), ``unlisted`` (an effect in no
list), ``triple`` (gap bending, tether weight and a segment's bias at once), ``tie`` (dead time or clock, the
recommended instrument then added). Prints the confusion matrix and every rate with its 99 % Clopper-Pearson
interval, beside what three simpler methods say of the same sets.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.intervals import interval, rate

KINDS = ("null", "typical", "third", "unlisted", "triple")
SHARES = {"null": 0.34, "typical": 0.30, "third": 0.16, "unlisted": 0.16, "triple": 0.04}
TRIPLE = ("gap_bending", "tether_weight", "segment_bias")
# what counts as the right class when the name itself is not it
CLASSES = (
    {"dead_time", "clock_offset"},
    {"curvature_bias", "segment_bias", "single_wheel_toe", "wheel_toe"},
    {"floor_slope", "tether_pull"},
    {"tether_drag", "tether_viscous", "tether_weight"},
    {"camera_scale", "gap_length"},
    {"hysteresis", "fill_exhaust_asymmetry"},
    {"curvature_stiffening", "supply_droop", "bending_resistance"},
)
Row = dict[str, Any]


def plan(sets: int, seed: int, kinds: Sequence[str]) -> list[tuple[str, tuple[str, ...], int]]:
    """Return (kind, hidden effects, seed) of every set; effects take turns."""
    from virtual_lab.catalogue import LISTED, UNLISTED

    share = sum(SHARES[k] for k in kinds)
    found: list[tuple[str, tuple[str, ...], int]] = []
    for kind in kinds:
        count = max(1, round(sets * SHARES[kind] / share))
        pools = {"typical": list(LISTED), "third": list(LISTED), "unlisted": list(UNLISTED)}
        rng = np.random.default_rng([seed, KINDS.index(kind)])
        pool = [pools[kind][i] for i in rng.permutation(len(pools[kind]))] if kind in pools else []
        for k in range(count):
            hidden = TRIPLE if kind == "triple" else (pool[k % len(pool)],) if pool else ()
            found.append((kind, hidden, 100_000 * seed + 1000 * KINDS.index(kind) + k))
    return found


def generate(folder: Path, kind: str, hidden: tuple[str, ...], seed: int) -> dict[str, Any]:
    """Write one small set; return what is hidden in it."""
    from virtual_lab.dataset import Recording, write_dataset
    from virtual_lab.draw import draw_truth
    from virtual_lab.trials import small_design

    rng = np.random.default_rng([seed, 4])
    sizes = (0.7 / 3, 1.4 / 3) if kind == "third" else (0.7, 1.4)
    truth = draw_truth(hidden, rng, sizes)  # bench values off by up to two of their deviations
    stated = 0.001 * float(rng.choice([0.5, 1.0, 2.0]))
    recording = Recording(stated_sd_m=stated)
    trials = small_design(np.random.default_rng([seed, 5]))
    write_dataset(folder, truth, trials, seed, recording)
    return {"effects": [dict(e) for e in (*truth.effects, *truth.unlisted)]}


def examine(kind: str, hidden: tuple[str, ...], seed: int) -> Row:
    """Generate and examine one set."""
    from benchmarks.discrepancy_baselines import baselines
    from srs_opt.discrepancy.answer import answer
    from srs_opt.discrepancy.pipeline import find_discrepancy
    from srs_opt.measurement.dataset import load_dataset

    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "set"
        truth = generate(folder, kind, hidden, seed)
        dataset = load_dataset(folder)
        cpu = time.process_time()
        try:
            found = find_discrepancy(dataset)
        except Exception as error:
            return {"kind": kind, "hidden": list(hidden), "seed": seed, "verdict": f"crash: {error!r}"}
        said = answer(found, None)
        row: Row = {
            "kind": kind,
            "hidden": list(hidden),
            "truth": truth["effects"],
            "seed": seed,
            "verdict": said["verdict"],
            "why": said["why"],
            "named": sorted(e["name"] for e in said["effects"]),
            "effects": said["effects"],
            "alternatives": said["alternatives"],
            "ratio": said["gap"]["ratio"] if said["gap"] else None,
            "top": [c["name"] for c in said["candidates"][:3]],
            "next": said["next_experiment"],
            "seconds": said["seconds"],
            "cpu_s": round(time.process_time() - cpu, 1),
        }
        if found.null is not None and found.best is not None:
            row["p_null"], row["p_best"] = found.null.detection.p_value, found.best.detection.p_value
            row["best"] = found.best.hypothesis.label
            row["fits"] = {
                h.label: round(h.deviance - found.null.hypothesis.deviance, 1) for h in found.fitted
            }
        row["baselines"] = baselines(found)
        return row


def right_name(row: Row) -> bool:
    """Whether the name (or, for a tie, the pair that holds it) is what is hidden."""
    hidden = sorted(set(row["hidden"]))
    sets = [row["named"], *row["alternatives"]]
    if row["verdict"] == "named":
        return row["named"] == hidden
    tie = set(hidden) <= {"dead_time", "clock_offset"}
    return bool(row["verdict"] == "one_of" and tie and hidden in [sorted(s) for s in sets])


def right_class(row: Row) -> bool:
    """Whether the hidden effect, or a look-alike, is among what is said."""
    if row["verdict"] not in ("named", "one_of"):
        return False
    hidden = sorted(set(row["hidden"]))
    for said in (row["named"], *row["alternatives"]):
        if sorted(said) == hidden:
            return True
        if len(said) == len(hidden) == 1 and any({said[0], hidden[0]} <= c for c in CLASSES):
            return True
    return False


def summarise(rows: list[Row]) -> str:
    """Return the rates and the confusion matrix as text."""
    of = {kind: [r for r in rows if r["kind"] == kind] for kind in KINDS}
    lines = []

    def say(what: str, hits: int, total: int, goal: str) -> None:
        if total:
            low, high = interval(hits, total)
            lines.append(f"{what:58s} {rate(hits, total)}  [{low:.3f}, {high:.3f}]  goal {goal}")

    nulls = of["null"]
    say("null: false alarm", sum(r["verdict"] != "no_gap" for r in nulls), len(nulls), "0.05")
    say("null: false name", sum(r["verdict"] in ("named", "one_of") for r in nulls), len(nulls), "<= 0.02")
    for kind, goals in (("typical", (">= 0.90", ">= 0.95")), ("third", ("", ">= 0.75"))):
        say(f"{kind}: right name", sum(map(right_name, of[kind])), len(of[kind]), goals[0])
        say(f"{kind}: right class", sum(map(right_class, of[kind])), len(of[kind]), goals[1])
    named = [r for r in rows if r["verdict"] == "named" and r["kind"] in ("typical", "third", "triple")]
    say("when named: right", sum(map(right_name, named)), len(named), ">= 0.97")
    unlisted = of["unlisted"]
    say("unlisted: not named", sum(r["verdict"] != "named" for r in unlisted), len(unlisted), ">= 0.85")
    say("triple: right set", sum(map(right_name, of["triple"])), len(of["triple"]), "a set")
    ratios = [r["ratio"] for r in named if right_name(r) and r["ratio"] is not None]
    if ratios:
        lines.append(f"sealed gap ratio when named right: median {np.median(ratios):.3f}, goal <= 0.15")
    for method in ("nearest_shape", "forward_aic", "sparse_regression"):
        hits = [r for r in of["typical"] if r.get("baselines", {}).get(method) == sorted(r["hidden"])]
        say(f"baseline {method}, typical: right name", len(hits), len(of["typical"]), "")
        wrong = [r for r in nulls if r.get("baselines", {}).get(method)]
        say(f"baseline {method}, null: false name", len(wrong), len(nulls), "")
    times = [r["cpu_s"] for r in rows if "cpu_s" in r]
    lines.append(f"{len(rows)} sets, processor time per set: median {np.median(times or [0]):.1f} s")
    lines += ["", "hidden -> said:"]
    counts = Counter((r["kind"], "+".join(r["hidden"]) or "-", _said(r)) for r in rows)
    lines += [
        f"  {kind:9s} {hidden:42s} {said:60s} {n}" for (kind, hidden, said), n in sorted(counts.items())
    ]
    return "\n".join(lines)


def _said(row: Row) -> str:
    if row["verdict"] in ("named", "one_of"):
        others = "".join(" | " + "+".join(a) for a in row["alternatives"])
        return f"{row['verdict']}: {'+'.join(row['named'])}{others}"
    return str(row["verdict"])[:58]


def main(argv: list[str] | None = None) -> int:
    """Run the benchmark and print its rates."""
    from joblib import Parallel, delayed

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sets", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--rows", type=Path, help="write every set's answer to this file, one JSON per line")
    options = parser.parse_args(argv)
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    started = time.perf_counter()
    jobs = plan(options.sets, options.seed, options.kinds)
    rows: list[Row] = []
    stream = options.rows.open("w") if options.rows else None
    work = Parallel(n_jobs=options.jobs, return_as="generator_unordered")(delayed(examine)(*j) for j in jobs)
    for row in work:
        rows.append(row)
        print(
            f"{len(rows)}/{len(jobs)} {row['kind']:9s} {'+'.join(row['hidden']) or '-':30s} {_said(row)}",
            file=sys.stderr,
        )
        if stream:
            print(json.dumps(row), file=stream, flush=True)
    print(summarise(rows))
    print(f"{time.perf_counter() - started:.0f} s on {options.jobs} processes")
    return 0


if __name__ == "__main__":
    sys.exit(main())

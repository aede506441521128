"""How often ``srs_opt.discrepancy`` is right, over sets from a laboratory that shares no code with it.

    python -m benchmarks.discrepancy --sets 475 --seed 5 --jobs 2

Kinds of sets: ``null`` (nothing hidden; bench values off, noise misstated), ``typical`` (one effect at 0.7 to
1.4 times its typical size, place at random), ``third`` (a third of that), ``unlisted`` (an effect in no
list), ``triple`` (gap bending, tether weight and a segment's bias at once), ``tie`` (dead time or clock, the
recommended instrument then added). Prints the confusion matrix and every rate with its 99 % Clopper-Pearson
interval, beside what three simpler methods say of the same sets. Interrupted, it goes on where it was.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.intervals import interval, rate
from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser

KINDS = ("null", "typical", "third", "unlisted", "triple")
# as many nulls as a false-alarm rate needs; every effect three times, twice at a third of its size
SHARES = {"null": 300 / 475, "typical": 75 / 475, "third": 50 / 475, "unlisted": 44 / 475, "triple": 6 / 475}
TRIPLE = ("gap_bending", "tether_weight", "segment_bias")
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
            "alike": said["alike"],
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
    """Whether the hidden effect, or one that acts alike on that set, is among what is said."""
    if row["verdict"] not in ("named", "one_of"):
        return False
    hidden = sorted(set(row["hidden"]))
    alike = [set(pair["effects"]) for pair in row.get("alike", ())]
    for said in (row["named"], *row["alternatives"]):
        if sorted(said) == hidden:
            return True
        if len(said) == len(hidden) == 1 and {said[0], hidden[0]} in alike:
            return True
    return False


def rates(rows: Sequence[Row]) -> list[list[str]]:
    """Return what is counted, hits of total, its 99 % interval, and the goal."""
    of = {kind: [r for r in rows if r["kind"] == kind] for kind in KINDS}
    lines: list[list[str]] = []

    def say(what: str, hits: Iterable[bool], goal: str = "") -> None:
        found = list(hits)
        if found:
            low, high = interval(sum(found), len(found))
            lines.append([what, rate(sum(found), len(found)).strip(), f"{low:.3f} to {high:.3f}", goal])

    say("null: false alarm", (r["verdict"] != "no_gap" for r in of["null"]), "0.05")
    say("null: false name", (r["verdict"] in ("named", "one_of") for r in of["null"]), "<= 0.02")
    for kind, goals in (("typical", (">= 0.90", ">= 0.95")), ("third", ("", ">= 0.75"))):
        say(f"{kind}: right name", map(right_name, of[kind]), goals[0])
        say(f"{kind}: right class", map(right_class, of[kind]), goals[1])
    named = [r for r in rows if r["verdict"] == "named" and r["kind"] in ("typical", "third", "triple")]
    say("when named: right", map(right_name, named), ">= 0.97")
    say("unlisted: not named", (r["verdict"] != "named" for r in of["unlisted"]), ">= 0.85")
    say("triple: right set", map(right_name, of["triple"]), "a set")
    for method in ("nearest_shape", "forward_aic", "sparse_regression"):
        said = {kind: [r.get("baselines", {}).get(method) for r in of[kind]] for kind in ("typical", "null")}
        right = (names == sorted(r["hidden"]) for names, r in zip(said["typical"], of["typical"]))
        say(f"typical: right name, by {method.replace('_', ' ')}", right)
        say(f"null: false name, by {method.replace('_', ' ')}", map(bool, said["null"]))
    return lines


def in_words(rows: Sequence[Row]) -> list[str]:
    """Return what is no rate: the gap that is left, and the cost."""
    right = [r for r in rows if r["verdict"] == "named" and right_name(r)]
    ratios = [r["ratio"] for r in right if r["ratio"] is not None]
    times = [r["cpu_s"] for r in rows if "cpu_s" in r]
    words = [f"{len(rows)} sets, processor time per set: median {np.median(times or [0]):.1f} s."]
    if ratios:
        words.append(f"Sealed gap ratio when named right: median {np.median(ratios):.3f}, goal <= 0.15.")
    return words


def confusion(rows: Sequence[Row]) -> str:
    """Return what was said of what, as text."""
    counts = Counter((r["kind"], "+".join(r["hidden"]) or "-", _said(r)) for r in rows)
    return "\n".join(
        f"{kind:9s} {hidden:42s} {said:60s} {n}" for (kind, hidden, said), n in sorted(counts.items())
    )


def _said(row: Row) -> str:
    if row["verdict"] in ("named", "one_of"):
        others = "".join(" | " + "+".join(a) for a in row["alternatives"])
        return f"{row['verdict']}: {'+'.join(row['named'])}{others}"
    return str(row["verdict"])[:58]


def run(quick: bool) -> Section:
    """Return the rates of the stored study; two sets, measured now, where there is none or to be quick."""
    stored = None if quick else stored_rows("discrepancy")
    if stored is None:
        stored = "now, two sets only", [examine(*job) for job in plan(2, 1, ("null", "typical"))]
    measured, rows = stored
    notes = [f"Measured {measured}.", *in_words(rows), f"```text\n{confusion(rows)}\n```"]
    columns = ["kind of set: what is counted", "rate", "99 % interval", "goal"]
    return Section("Discrepancy: how often it is right", columns, rates(rows), notes)


def main(argv: list[str] | None = None) -> int:
    """Run the study and print its rates."""
    parser = study_parser("discrepancy", __doc__, 475)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    options = parser.parse_args(argv)
    rows = gather("discrepancy", examine, plan(options.sets, options.seed, options.kinds), options)
    for what, hits, span, goal in rates(rows):
        print(f"{what:58s} {hits}  [{span}]  {goal and 'goal '}{goal}")
    print(*in_words(rows), "", "hidden -> said:", confusion(rows), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())

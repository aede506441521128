"""How often ``srs_opt.discrepancy`` is right, over sets from a laboratory that shares no code with it.

    python -m benchmarks.discrepancy --sets 519 --seed 5 --jobs 2 [--setting second]

Settings of the generator: `first`, white noise alone; `second`, friction smoothed over another speed, 0.1 mm
of systematic motion and 0.2 mm of noise that is correlated over 0.2 s.

Kinds of sets: ``null`` (nothing hidden; bench values off, noise misstated), ``typical`` (one effect at 0.7 to
1.4 times its typical size, place at random), ``third`` (a third of that), ``unlisted`` (an effect in no
list), ``triple`` (gap bending, tether weight and a segment's bias at once), ``bad`` (one trial is not what
the notebook says; in every other set an effect besides). Prints the confusion matrix and every rate with its
99 % Clopper-Pearson interval, beside what three simpler methods say of the same sets. Interrupted, it goes on
where it was.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.discrepancy_described import described
from benchmarks.intervals import interval, rate
from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser

KINDS = ("null", "typical", "third", "unlisted", "triple", "bad")
# as many nulls as a false-alarm rate needs; every effect three times, twice at a third of its size
SHARES = {"null": 300 / 475, "typical": 75 / 475, "third": 50 / 475, "unlisted": 44 / 475, "triple": 6 / 475,
          "bad": 44 / 475}  # fmt: skip
# what the second generator has beside what is hidden: nobody's model knows of it
FRICTION_SPEED_M_S = {"first": 0.0003, "second": 0.001}
DISTURBED: dict[str, dict[str, float]] = {
    "first": {},
    "second": {"systematic_sd_m": 1e-4, "correlated_sd_m": 2e-4, "correlation_s": 0.2},
}
KEPT = ("verdict", "why", "believed", "effects", "described", "alternatives", "alike", "lead", "remainder",
        "would_have_seen", "gap", "noise", "set_aside", "seconds")  # fmt: skip
LEFT = (("m", "mm", 1e3), ("share", "% of the gap", 100),
        ("speed_share", "% of speed", 100), ("radius_share", "% of radius", 100))  # fmt: skip
COVERED = 1.645  # standard deviations to either side that hold 90 %
TRIPLE = ("gap_bending", "tether_weight", "segment_bias")
Row = dict[str, Any]


def plan(sets: int, seed: int, kinds: Sequence[str]) -> list[tuple[str, tuple[str, ...], int]]:
    """Return (kind, hidden effects, seed) of every set; effects take turns."""
    from virtual_lab.catalogue import LISTED, UNLISTED

    share = sum(SHARES[k] for k in kinds)
    found: list[tuple[str, tuple[str, ...], int]] = []
    for kind in kinds:
        count = max(1, round(sets * SHARES[kind] / share))
        listed = list(LISTED)
        pools = {"typical": listed, "third": listed, "unlisted": list(UNLISTED), "bad": listed}
        rng = np.random.default_rng([seed, KINDS.index(kind)])
        pool = [pools[kind][i] for i in rng.permutation(len(pools[kind]))] if kind in pools else []
        for k in range(count):
            hidden = TRIPLE if kind == "triple" else (pool[k % len(pool)],) if pool else ()
            hidden = () if kind == "bad" and k % 2 else hidden
            found.append((kind, hidden, 100_000 * seed + 1000 * KINDS.index(kind) + k))
    return found


def generate(
    folder: Path,
    kind: str,
    hidden: tuple[str, ...],
    seed: int,
    setting: str = "first",
    *,
    brief: bool = False,
) -> dict[str, Any]:
    """Write one small set, or `brief` half a set of short trials; return what is hidden in it."""
    from virtual_lab.dataset import Recording, truth_file, write_dataset
    from virtual_lab.disturb import WRONG_ENTRIES
    from virtual_lab.draw import draw_truth
    from virtual_lab.trials import small_design

    rng = np.random.default_rng([seed, 4])
    sizes = (0.7 / 3, 1.4 / 3) if kind == "third" else (0.7, 1.4)
    truth = draw_truth(hidden, rng, sizes)  # bench values off by up to two of their deviations
    truth = replace(truth, friction_speed_m_s=FRICTION_SPEED_M_S[setting])
    stated = 0.001 * float(rng.choice([0.5, 1.0, 2.0]))
    wrong = str(rng.choice(list(WRONG_ENTRIES))) if kind == "bad" else ""
    recording = replace(Recording(stated_sd_m=stated, wrong_entry=wrong), **DISTURBED[setting])
    trials = small_design(np.random.default_rng([seed, 5]), 1.5 if brief else 4.0)[: 6 if brief else None]
    write_dataset(folder, truth, trials, seed, recording)
    bad = json.loads(truth_file(folder).read_text(encoding="utf-8"))["wrong_trial"]
    effects = [dict(e) for e in (*truth.effects, *truth.unlisted)]
    return {"effects": effects, "wrong_entry": wrong, "wrong_trial": bad}


def examine(
    kind: str, hidden: tuple[str, ...], seed: int, setting: str = "first", *, brief: bool = False
) -> Row:
    """Generate and examine one set, see `generate`."""
    from benchmarks.discrepancy_baselines import baselines
    from srs_opt.discrepancy.answer import answer
    from srs_opt.discrepancy.pipeline import diagnose
    from srs_opt.measurement.dataset import load_dataset

    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "set"
        truth = generate(folder, kind, hidden, seed, setting, brief=brief)
        row: Row = {"kind": kind, "setting": setting, "hidden": list(hidden), "seed": seed}
        row |= {"truth": truth["effects"], **{k: truth[k] for k in ("wrong_entry", "wrong_trial")}}
        dataset = load_dataset(folder)
        cpu = time.process_time()
        try:
            found = diagnose(dataset)
            cpu_s = time.process_time() - cpu
            said, simpler = answer(found, None), baselines(found)
        except Exception as error:  # one set less, not a study of hours
            return row | {"verdict": f"crash: {error!r}", "named": [], "alternatives": [], "effects": []}
        row |= {key: said[key] for key in KEPT}
        row |= {
            "named": sorted(e["name"] for e in said["effects"]),
            "ratio": said["gap"]["ratio"] if said["gap"] else None,
            "top": [c["name"] for c in said["candidates"][:3]],
            "next": said["next_experiment"],
            "cpu_s": round(cpu_s, 1),
        }
        if found.null is not None and found.best is not None:
            row["p_null"], row["p_best"] = found.null.detection.p_value, found.best.detection.p_value
            row["best"] = found.best.hypothesis.label
            row["fits"] = {
                h.label: round(h.deviance - found.null.hypothesis.deviance, 1) for h in found.fitted
            }
        row["baselines"] = simpler
        return row


def right_name(row: Row) -> bool:
    """Whether the name (or, for a tie, the pair that holds it) is what is hidden."""
    hidden = sorted(set(row["hidden"]))
    sets = [row["named"], *row["alternatives"]]
    if row["verdict"] == "named":
        return row["named"] == hidden
    tie = set(hidden) <= {"dead_time", "clock_offset"}
    return bool(row["verdict"] == "one_of" and tie and hidden in [sorted(s) for s in sets])


def wrong_name(row: Row) -> bool:
    """Whether something is believed that is not hidden."""
    return row["verdict"] in ("named", "named_in_part") and not set(row["named"]) <= set(row["hidden"])


def bad_found(row: Row) -> bool:
    """Whether the trial with the wrong entry is pointed out by name."""
    aside = {t["trial"] for t in row.get("set_aside", ())}
    return row["wrong_trial"] in aside or f"trial {row['wrong_trial']} contradicts" in row.get("why", "")


def covered(row: Row) -> list[bool]:
    """Return whether 90 % intervals hold the sizes of the effects of a row that names rightly."""
    said = {e["name"]: e for e in row["effects"]}
    found = []
    for true in row["truth"]:
        entry = said[true["name"]]
        size = next(key for key in true if key != "name")
        if entry["sd"].get(size, 0) > 0:
            found.append(abs(entry["parameters"][size] - true[size]) <= COVERED * entry["sd"][size])
    return found


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

    say("null: false alarm", (r["verdict"] != "no_gap" for r in of["null"]), "<= 0.05")
    spoken = ("named", "named_in_part", "described", "one_of")
    say("null: false name", (r["verdict"] in spoken for r in of["null"]), "none")
    for kind, goals in (("typical", (">= 0.90", ">= 0.95")), ("third", ("", ">= 0.75"))):
        say(f"{kind}: right name", map(right_name, of[kind]), goals[0])
        say(f"{kind}: right class", map(right_class, of[kind]), goals[1])
    named = [r for r in rows if r["verdict"] == "named" and r["kind"] in ("typical", "third", "triple")]
    say("when named: right", map(right_name, named), ">= 0.97")
    others = [r for kind in KINDS if kind not in ("null", "unlisted") for r in of[kind]]
    say("listed: wrong name", map(wrong_name, others), "none")
    say("unlisted: wrong name", map(wrong_name, of["unlisted"]), "<= 0.05")
    for what, hits, goal in described(of["unlisted"]):
        say(what, hits, goal)
    say("bad trial: found", map(bad_found, of["bad"]), ">= 0.9")
    held = [c for r in rows if r["kind"] in ("typical", "third") and right_name(r) and r["verdict"] == "named"
            for c in covered(r)]  # fmt: skip
    say("when named: 90 % interval holds the size", held, "0.85 to 0.95")
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
    left = [r["remainder"] for r in right if r.get("remainder")]
    if left:
        figures = []
        for key, unit, scale in LEFT:
            values = [scale * x[key] for x in left if x[key] is not None]
            if values:
                figures.append(f"{np.median(values):.2g} (90 %: {np.quantile(values, 0.9):.2g}) {unit}")
        words.append(f"Left beyond the noise when named right: {', '.join(figures)}.")
    return words


def confusion(rows: Sequence[Row]) -> str:
    """Return what was said of what, as text."""
    counts = Counter((r["kind"], "+".join(r["hidden"]) or "-", _said(r)) for r in rows)
    return "\n".join(
        f"{kind:9s} {hidden:42s} {said:60s} {n}" for (kind, hidden, said), n in sorted(counts.items())
    )


def _said(row: Row) -> str:
    if row["verdict"] in ("named", "named_in_part", "one_of"):
        others = "".join(" | " + "+".join(a) for a in row["alternatives"])
        return f"{row['verdict']}: {'+'.join(row['named'])}{others}"
    return str(row["verdict"])[:58]


def run(quick: bool) -> Section:
    """Return the rates of the stored studies; one brief set, measured now, where there is none or to be
    quick."""
    lines: list[list[str]] = []
    notes: list[str] = []
    for setting in DISTURBED:
        name = "discrepancy" if setting == "first" else f"discrepancy_{setting}"
        stored = None if quick else stored_rows(name)
        if stored is None and setting != "first":
            continue
        if stored is None:
            stored = "now, one brief set only", [examine(*plan(1, 1, ("null",))[0], brief=True)]
        measured, rows = stored
        lines += [[f"{setting}, {what}", *rest] for what, *rest in rates(rows)]
        notes += [
            f"Setting {setting}: measured {measured}.",
            *in_words(rows),
            f"```text\n{confusion(rows)}\n```",
        ]
    columns = ["generator's setting, kind of set: what is counted", "rate", "99 % interval", "goal"]
    return Section("Discrepancy: how often it is right", columns, lines, notes)


def main(argv: list[str] | None = None) -> int:
    """Run the study and print its rates."""
    parser = study_parser("discrepancy", __doc__, 519)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--setting", choices=list(DISTURBED), default="first", help="of the generator")
    options = parser.parse_args(argv)
    if options.setting != "first" and options.rows == parser.get_default("rows"):
        options.rows = options.rows.with_stem(f"discrepancy_{options.setting}")
    jobs = [(*job, options.setting) for job in plan(options.sets, options.seed, options.kinds)]
    rows = gather("discrepancy", examine, jobs, options)
    for what, hits, span, goal in rates(rows):
        print(f"{what:58s} {hits}  [{span}]  {goal and 'goal '}{goal}")
    print(*in_words(rows), "", "hidden -> said:", confusion(rows), sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())

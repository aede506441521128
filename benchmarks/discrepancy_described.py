"""How often a term of the grammar describes what is in no list: the right kind, the right link or segment.

    python -m benchmarks.discrepancy_described --sets 48 --seed 7

Sets of the independent laboratory, each with one unlisted effect at 0.7 to 1.4 times its typical size; they
take turns. Only the last step is asked, as if no listed effect had explained anything: calibration, then the
terms. ``benchmarks.discrepancy`` counts the whole workflow by the same rule.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from benchmarks.intervals import interval, rate
from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser

ALONG, ACROSS = "friction along the wheels", "friction across the wheels"
LOAD, FORCE, STEERING = "load or mass", "force", "direction of the wheels"
LENGTH, GAIN, TIME, CAMERA = "length", "actuator's gain", "actuator's time", "camera"
# what acts; more than one where they are the same thing on a robot that goes forward
KINDS: Mapping[str, tuple[str, ...]] = {
    "quadratic_drag": (FORCE, ALONG),
    "hose_spring": (FORCE,),
    "hose_torsion": (FORCE,),
    "carpet_edge": (ALONG,),
    "floor_waves": (FORCE,),
    "stiff_wheel": (ALONG,),
    "worn_wheels": (ACROSS,),
    "sideways_stiction": (ACROSS,),
    "bend_unloads": (LOAD,),
    "bend_steers": (STEERING,),
    "crosstalk": (GAIN,),
    "slow_valve": (TIME,),
    "tank_empties": (GAIN,),
    "compressor_ripple": (GAIN,),
    "warming_silicone": (TIME,),
    "leaking_segment": (GAIN,),
    "lopsided_chambers": (GAIN,),
    "long_segment": (LENGTH,),
    "payload": (LOAD,),
    "lens_barrel": (CAMERA,),
    "rolling_shutter": (CAMERA,),
    "swaying_camera": (CAMERA,),
    "clock_drift": (CAMERA,),
}
TAIL = ("hose_spring",)  # acts on link 1, though it has no such parameter
Row = dict[str, Any]


def right_description(
    truth: Sequence[Mapping[str, Any]], said: Sequence[Mapping[str, Any]]
) -> tuple[bool, bool]:
    """Return whether a description tells the right kind, and the right link or segment where there is one.

    Parameters
    ----------
    truth : sequence of mapping
        The hidden effects, with their parameters.
    said : sequence of mapping
        The answer's `effects`: `name` and `parameters` of generic terms.
    """
    from srs_opt.effects.generic import TERMS

    if len(truth) != 1 or len(said) != 1 or said[0]["name"] not in TERMS:
        return False, False
    hidden, parameters = truth[0], said[0]["parameters"]
    kind = TERMS[said[0]["name"]].acts in KINDS.get(str(hidden["name"]), ())
    places = {key: hidden[key] for key in ("link", "segment") if key in hidden}
    if hidden["name"] in TAIL:
        places = {"link": 1}
    return kind, all(parameters.get(key) == place for key, place in places.items())


def described(rows: Iterable[Row]) -> list[tuple[str, list[bool], str]]:
    """Return what is counted of rows with `truth`, `effects` and `verdict`: what, hits, and the goal."""
    right = [
        right_description(r.get("truth", ()), r.get("effects", ())) if r["verdict"] == "described" else None
        for r in rows
    ]
    said = [r for r in right if r is not None]
    return [
        ("unlisted: described, right kind and place", [r == (True, True) for r in right], ">= 0.6"),
        ("unlisted: described otherwise", [r is not None and r != (True, True) for r in right], ""),
        ("when described: right kind", [kind for kind, _ in said], ""),
        ("when described: right place", [place for _, place in said], ""),
    ]


def examine(hidden: str, seed: int, *, brief: bool = False) -> Row:
    """Generate one set, calibrate, and describe what is left."""
    from benchmarks.discrepancy import generate
    from srs_opt.calibrate.candidates import effect_spec, fitted_coordinates
    from srs_opt.calibrate.experiment import Experiment
    from srs_opt.calibrate.model import Model
    from srs_opt.calibrate.noise import noise_of
    from srs_opt.discrepancy.describe import describe_gap
    from srs_opt.discrepancy.search import Search
    from srs_opt.discrepancy.split import few_and_brief, split_trials
    from srs_opt.measurement.dataset import load_dataset

    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "set"
        truth = generate(folder, "unlisted", (hidden,), seed, brief=brief)
        dataset = load_dataset(folder)
    split = split_trials(dataset.trials)
    quick = few_and_brief(split.open)
    trials = (*split.open, *split.sealed, *quick)
    experiment = Experiment(Model(dataset.robot), trials, noise_of(dataset), dataset.bench)
    search = Search(experiment, fitted_coordinates(dataset.robot), (), split.open, quick=quick)
    row: Row = {"hidden": [hidden], "truth": truth["effects"], "seed": seed, "verdict": "unknown"}
    null = search.calibrate()
    started = time.process_time()
    found = None if null is None else describe_gap(search, null, null, split.sealed)
    if found is None or null is None:
        return row
    candidate = found.best.candidates[0]
    entry = effect_spec(candidate, found.best.fit.point.values)
    return row | {
        "verdict": "unknown" if found.why_not else "described",
        "why_not": found.why_not,
        "sentence": found.sentence,
        "effects": [{"name": entry.pop("name"), "parameters": entry}],
        "misfit": [round(h.fit.misfit_ratio, 4) for h in (null, found.best)],
        "ratio": found.gap.ratio if found.gap else None,
        "tried": {h.label: round(h.fit.misfit_ratio, 3) for h in found.tried},
        "cpu_s": round(time.process_time() - started, 1),
    }


def plan(sets: int, seed: int) -> list[tuple[str, int]]:
    """Return (hidden effect, seed) of every set; effects take turns."""
    names = list(KINDS)
    return [(names[k % len(names)], 100_000 * seed + k) for k in range(sets)]


def run(quick: bool) -> Section:
    """Return the rates of the stored study, quick or not; one brief set, measured now, where there is
    none."""
    stored = stored_rows("discrepancy_described")
    if stored is None:
        stored = "now, one brief set only", [examine("stiff_wheel", 1, brief=True)]
    measured, rows = stored
    columns = ["what is counted", "rate", "99 % interval", "goal"]
    table = []
    for what, hits, goal in described(rows):
        if hits:
            low, high = interval(sum(hits), len(hits))
            table.append([what, rate(sum(hits), len(hits)).strip(), f"{low:.3f} to {high:.3f}", goal])
    said = [f"{r['hidden'][0]:20s} {r.get('sentence', '-')} {_in_brackets(r.get('why_not'))}" for r in rows]
    notes = [f"Measured {measured}.", "```text\n" + "\n".join(said) + "\n```"]
    return Section("Discrepancy: what is in no list, described", columns, table, notes)


def _in_brackets(text: str | None) -> str:
    return f"(not believed: {text})" if text else ""


def main(argv: list[str] | None = None) -> int:
    """Run the study and print its rates."""
    parser = study_parser("discrepancy_described", __doc__, 2 * len(KINDS))
    options = parser.parse_args(argv)
    rows = gather("discrepancy_described", examine, plan(options.sets, options.seed), options)
    for what, hits, goal in described(rows):
        if hits:
            print(f"{what:50s} {rate(sum(hits), len(hits))}  {goal and 'goal '}{goal}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Command: find the effect that the model lacks, name it or say why not."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from srs_opt.command import Answer, Parser, make_parser, run_command, say
from srs_opt.processes import one_thread_of_linear_algebra

if TYPE_CHECKING:
    from srs_opt.discrepancy.pipeline import Discrepancy


def build_parser() -> Parser:
    """Return the command's parser."""
    parser = make_parser(
        "python -m srs_opt.discrepancy",
        "Find where simulation and measured data disagree, name the missing effect or abstain, show the gap\n"
        "shrink on trials that no fit saw. Writes report.html and corrected_robot.yaml.\n"
        "JSON: verdict (no_gap, named, one_of, unknown, not_testable), effects, alternatives, located,\n"
        "gap (m, root mean square per coordinate), next_experiment, candidates, corrected_robot, seconds;\n"
        "with --payoff also payoff (m/s, rad/s; null where nothing was named).",
        "python -m srs_opt.discrepancy data/my_set --json",
        robot=False,
        sweep=True,
    )
    parser.add_argument("dataset", type=Path, metavar="DATASET", help="folder of the data set")
    parser.add_argument(
        "--effects",
        type=Path,
        metavar="FILE",
        help="YAML list of effect names to consider (default: all that are known)",
    )
    parser.add_argument(
        "--payoff",
        action="store_true",
        help="also optimize the fastest gait of the calibrated and of the corrected robot, and show what the "
        "name changes (half a minute when first compiled, then some seconds)",
    )
    parser.add_argument("--model", choices=("complex", "simplified"), default="complex", help="dynamic model")
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Find the discrepancy; write the report and the corrected robot."""
    from srs_opt.discrepancy.answer import answer, corrected_robot
    from srs_opt.discrepancy.payoff import payoff
    from srs_opt.discrepancy.pipeline import find_discrepancy
    from srs_opt.discrepancy.report import write_report
    from srs_opt.measurement.dataset import load_dataset
    from srs_opt.robot import save_robot

    dataset = load_dataset(options.dataset)
    effects = _effect_names(options.effects) if options.effects else None
    found = find_discrepancy(
        dataset,
        effects,
        model=options.model,
        seed=options.seed,
        jobs=options.jobs,
        cluster=options.cluster,
        report=lambda message: say(options, message),
    )
    robot = corrected_robot(found)
    files = []
    if robot is not None:
        files.append(save_robot(robot, options.out / "corrected_robot.yaml"))
    record = answer(found, files[0] if files else None)
    summary = _summary(found)
    if options.payoff:
        gains = payoff(found, options.model, lambda message: say(options, message))
        record["payoff"] = None if gains is None else gains.to_record() | {"words": gains.in_words()}
        summary += "" if gains is None else f"\n{gains.in_words()}"
    files.append(write_report(found, record, options.out / "report.html"))
    return Answer(record, summary, good=found.verdict.word != "not_testable", files=tuple(files))


def _effect_names(path: Path) -> list[str]:
    """Read the names to consider: a list, or a mapping with the key `effects`."""
    from srs_opt.document import read_yaml, unknown_word
    from srs_opt.model.effects import all_effects

    document = read_yaml(path, "a list of effect names (YAML)")
    value = document.value.get("effects") if isinstance(document.value, dict) else document.value
    if not isinstance(value, list) or not value:
        raise document.error((), "expected a list of effect names")
    names = [str(v["name"]) if isinstance(v, dict) and "name" in v else str(v) for v in value]
    for i, name in enumerate(names):
        if name not in all_effects():
            raise document.error((i,), unknown_word("effect", name, sorted(all_effects())))
    return names


def _summary(found: Discrepancy) -> str:
    lines = [f"{found.verdict.word}: {found.verdict.why}"]
    gap = found.gap
    if gap is not None and gap.ratio is not None and found.verdict.word in ("named", "one_of"):
        lines.append(
            f"sealed trials: {gap.calibrated * 1e3:.3f} mm calibrated, {gap.with_effect * 1e3:.3f} mm with "
            f"the effect, noise floor {gap.noise_floor * 1e3:.3f} mm"
        )
    if found.next_experiment is not None:
        lines.append(f"next: {found.next_experiment.what}")
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit status."""
    one_thread_of_linear_algebra()
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    sys.exit(main())

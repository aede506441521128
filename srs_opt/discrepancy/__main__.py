"""Command: find the effect that the model lacks, name it or say why not."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from srs_opt.command import (
    Answer,
    Parser,
    add_model,
    make_parser,
    one_thread_of_linear_algebra,
    run_command,
    say,
)

if TYPE_CHECKING:
    from planners.maze.maze import Maze
    from srs_opt.discrepancy.pipeline import Discrepancy
    from srs_opt.figures import Picture
    from srs_opt.robot import Robot


def build_parser() -> Parser:
    """Return the command's parser."""
    parser = make_parser(
        "python -m srs_opt.discrepancy",
        "Find where simulation and measured data disagree, name the missing effect or abstain, show the gap\n"
        "shrink on trials that no fit saw. Writes report.html, discrepancy.json and a robot file.\n"
        "JSON (docs/formats.md): verdict (no_gap, named, named_in_part, described, one_of, unknown,\n"
        "not_testable), believed, effects, described, alternatives, lead, remainder (m, shares of gap,\n"
        "speed, radius), would_have_seen, gap (m, root mean square per coordinate), noise, set_aside,\n"
        "next_experiment, located, alike (pairs of effects, angle in rad), candidates, seconds;\n"
        "with --payoff also payoff (m/s, rad/s; null where nothing was named), with --maze payoff.maze\n"
        "(m, s): plans before and after, both driven on the corrected robot.",
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
    parser.add_argument(
        "--maze",
        type=Path,
        metavar="FILE",
        help="a maze (see plan --help) to plan through before and after as well; implies --payoff",
    )
    parser.add_argument(
        "--robot",
        type=Path,
        metavar="FILE",
        help="robot file to go on from (an earlier corrected_robot.yaml): its effects are part of the model, "
        "refitted where they have a deviation; bench values stay the data set's own",
    )
    add_model(parser)
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Find the discrepancy; write the report and the corrected robot."""
    from srs_opt.calibrate.run import going_on_from
    from srs_opt.discrepancy.pipeline import diagnose
    from srs_opt.measurement.dataset import load_dataset
    from srs_opt.parallel import executor
    from srs_opt.robot import load_robot

    dataset = load_dataset(options.dataset)
    if options.robot is not None:
        dataset = going_on_from(dataset, load_robot(options.robot))
    effects = _effect_names(options.effects) if options.effects else None
    maze = _maze(options, dataset.robot)
    with executor(options.jobs, options.cluster) as where:
        found = diagnose(
            dataset,
            effects,
            model=options.model,
            seed=options.seed,
            where=where,
            report=lambda message: say(options, message),
        )
        return _written(options, found, maze)


def _written(options: argparse.Namespace, found: Discrepancy, maze: Maze | None) -> Answer:
    """Write the corrected robot and the report, whose pictures simulate once more."""
    from srs_opt.discrepancy.answer import (
        DESCRIBED_FILE,
        answer,
        answered_robot,
        robot_header,
        robot_name,
    )
    from srs_opt.discrepancy.report import write_report
    from srs_opt.files import write_json
    from srs_opt.robot import save_robot

    robot = answered_robot(found)
    files = []
    if robot is not None:
        files.append(save_robot(robot, options.out / robot_name(found), robot_header(found)))
        if found.verdict.word == "described":
            files.append(save_robot(robot, options.out / DESCRIBED_FILE))
    record = answer(found, files[0] if files else None)
    summary = _summary(found)
    further: list[Picture] = []
    if options.payoff or maze is not None:
        record["payoff"], words, further = _payoff(options, found, maze)
        summary += words
    files.append(write_json(options.out / "discrepancy.json", record))
    files.append(write_report(found, record, options.out / "report.html", further))
    return Answer(record, summary, good=found.verdict.word != "not_testable", files=tuple(files))


def _maze(options: argparse.Namespace, robot: Robot) -> Maze | None:
    """Return the maze of --maze, looked at before anything slow."""
    if options.maze is None:
        return None
    from planners.apps.payoff import payoff_maze

    return payoff_maze(robot, options.maze)


def _payoff(
    options: argparse.Namespace, found: Discrepancy, maze: Maze | None
) -> tuple[dict[str, Any] | None, str, list[Picture]]:
    """Return what the name changes: for the record, in words, and as pictures."""
    from srs_opt.discrepancy.payoff import payoff
    from srs_opt.figures import encoded

    def tell(message: str) -> None:
        say(options, message)

    gains = payoff(found, options.model, tell)
    if gains is None:
        return None, "", []
    record = gains.to_record() | {"words": gains.in_words()}
    if maze is None:
        return record, f"\n{gains.in_words()}", []
    from planners.apps.payoff import maze_payoff
    from planners.apps.payoff_picture import payoff_figure

    sides = (gains.calibrated, gains.promised.gait), (gains.corrected, gains.after.gait)
    runs = maze_payoff(*sides, maze, options.model, tell)
    record["maze"] = runs.to_record() | {"words": runs.in_words()}
    caption = (
        "Both plans are driven by the corrected robot, which stands for the real one: by the plan's valves "
        "alone (with the region that the body sweeps), and corrected every cycle"
    )
    picture = encoded(payoff_figure(runs), "Plans before and after, and what comes of them", f"{caption}.")
    return record, f"\n{gains.in_words()}\n{runs.in_words()}", [picture]


def _effect_names(path: Path) -> list[str]:
    """Read the names to consider: a list, or a mapping with the key `effects`."""
    from srs_opt.document import read_yaml, unknown_word
    from srs_opt.effects import all_effects

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
    from srs_opt.discrepancy.words import in_words

    return "\n".join([f"{found.verdict.word}: {found.verdict.why}", *in_words(found)])


def main(argv: list[str] | None = None) -> int:
    """Run the command; return its exit status."""
    one_thread_of_linear_algebra()
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    sys.exit(main())

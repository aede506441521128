"""``python -m planners.benchmark MAZE…``: OMPL's own benchmark over planners, on the same set-up."""

from __future__ import annotations

import argparse
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

from srs_opt.command import Answer, Parser, make_parser, positive_float, positive_int, run_command, say

if TYPE_CHECKING:
    from planners.benchmark.runs import Run

DEFAULT = ("lattice", "dubins-rrtconnect", "rs-rrtconnect", "rrt", "est", "kpiece1")


def build_parser() -> Parser:
    """Return the command's parser."""
    from planners.plan.__main__ import add_problem_options

    parser = make_parser(
        "python -m planners.benchmark",
        "Run ompl.tools.Benchmark over planners on the same planning problem: ours, OMPL's, your own.\n"
        "Every path found is then certified, outside the clock. Writes OMPL's logs, runs.json, a picture.",
        "python -m planners.benchmark mazes/first.yaml mazes/narrow.yaml --planner lattice,rrt --runs 5",
    )
    parser.add_argument("mazes", metavar="MAZE", nargs="+", help="as in plan")
    add_problem_options(parser)
    parser.add_argument(
        "--planner",
        type=lambda text: tuple(text.lower().split(",")),
        default=DEFAULT,
        metavar="NAME,…",
        help=f"planners, as in plan (default {','.join(DEFAULT)})",
    )
    parser.add_argument(
        "--runs", type=positive_int, default=3, metavar="N", help="of every planner (default 3)"
    )
    parser.add_argument(
        "--time-limit",
        type=positive_float,
        default=10.0,
        metavar="S",
        help="of a run, s (default %(default)g)",
    )
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Benchmark every maze."""
    from planners.benchmark.picture import save_benchmark_picture
    from planners.benchmark.runs import benchmark
    from planners.plan.inputs import problem_from
    from planners.plan.registry import planner_named
    from planners.search.ompl_setup import require_ompl
    from srs_opt.files import write_json, write_text

    require_ompl()
    for name in options.planner:
        planner_named(name)
    found: dict[str, list[Run]] = {}
    files: list[Path] = []
    for maze in options.mazes:
        options.maze = maze
        problem = problem_from(options)
        label = _label(Path(maze).stem, found)
        say(options, f"{label}: {len(options.planner)} planners, {options.runs} runs each")
        log, found[label] = benchmark(
            problem, options.planner, options.runs, options.time_limit, options.seed
        )
        files.append(write_text(options.out / f"{label}.log", log))
    record = {"mazes": {maze: [vars(run) for run in runs] for maze, runs in found.items()}}
    files.append(write_json(options.out / "runs.json", record))
    files += save_benchmark_picture(options.out / "benchmark", found, options.time_limit)
    return Answer(record, "\n".join(_lines(found)), True, tuple(files))


def _label(stem: str, taken: dict[str, Any]) -> str:
    label, number = stem, 2
    while label in taken:
        label, number = f"{stem}_{number}", number + 1
    return label


def _lines(found: dict[str, list[Run]]) -> list[str]:
    """Return the runs in words."""
    lines = []
    for maze, runs in found.items():
        for planner in dict.fromkeys(run.planner for run in runs):
            mine = [run for run in runs if run.planner == planner]
            plans = [run.duration_s for run in mine if run.duration_s is not None]
            played = f", plan of {median(plans):.1f} s" if plans else ""
            lines.append(
                f"{maze} {planner}: {sum(run.solved for run in mine)} of {len(mine)} solved, {len(plans)} "
                f"certified, {median(run.time_s for run in mine):.2f} s{played}"
            )
    return lines


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    raise SystemExit(main())

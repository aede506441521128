"""``python -m srs_opt.judge``: what another physics engine says of gaits and drives."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from srs_opt.command import (
    Answer,
    Parser,
    chosen_model,
    make_parser,
    positive_float,
    positive_int,
    run_command,
)

if TYPE_CHECKING:
    from srs_opt.judge.manoeuvres import Played
    from srs_opt.judge.opinion import Opinion
    from srs_opt.judge.replay import Replay
    from srs_opt.judge.settings import AgreementSettings
    from srs_opt.robot import Robot

SHOWN = 30  # rows of the printed table


def build_parser() -> Parser:
    """Return the command's options."""
    parser = make_parser(
        "python -m srs_opt.judge",
        "Play a gait, all gaits of a table, a plan or a manoeuvre in another physics engine (DART:\n"
        "rolling wheels, exact Coulomb contact) and say whether it agrees with us. Needs the extra 'judge'.\n"
        "Lengths in m, times in s, angles in rad. Exit status 1: it does not agree.",
        "python -m srs_opt.judge out/gait_opt/gait.json",
        sweep=True,
    )
    add = parser.add_argument
    add(
        "file",
        metavar="FILE",
        help="gait.json, gait_table.json (all), gait_table.json:NAME, schedule .csv, plan.json, motion.json, "
        "manoeuvre.json (with valves.csv beside it)",
    )
    add("--pressure", type=positive_float, default=55.0, metavar="KPA", help="for a schedule (default 55)")
    add(
        "--engine", default="dart", metavar="NAME",
        help="what judges gaits: dart, or one that a --plugin defines (default dart)",
    )  # fmt: skip
    add("--step", type=positive_float, default=1e-3, metavar="S", help="the engine's step (default 0.001)")
    add(
        "--refine",
        type=positive_int,
        default=3,
        metavar="N",
        help="gaits of a table, drawn by --seed, that are played at half the step and with twice the hinges "
        "too (default 3); a single gait always is",
    )
    add(
        "--tolerance",
        type=positive_float,
        default=0.02,
        metavar="SHARE",
        help="of speed, up to which it agrees, or 2 mm/s (of a robot as long as the built-in one); turn "
        "rates half as much again, or 0.02 rad/s "
        "(default 0.02)",
    )
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Read, play, compare."""
    from srs_opt.errors import InputError
    from srs_opt.judge.registry import DART, JUDGES
    from srs_opt.judge.settings import AGREEMENT
    from srs_opt.robot import load_robot

    judge = JUDGES.named(options.engine)
    judge.check_engine()
    robot = load_robot(options.robot)
    judge.check_robot(robot)
    name = Path(options.file).name
    if judge is not DART and name in ("plan.json", "motion.json", "manoeuvre.json"):
        raise InputError(f"--engine {judge.name}: a plan or a manoeuvre is played by {DART.name} only")
    shares = {"speed_share": options.tolerance, "turn_share": 1.5 * options.tolerance}
    tolerance = replace(AGREEMENT, **shares, body_m=robot.length_m)
    if name in ("plan.json", "motion.json"):
        return _motion(options, robot)
    if name == "manoeuvre.json":
        return _manoeuvre(options, robot)
    return _gaits(options, robot, tolerance)


def _motion(options: argparse.Namespace, robot: Robot) -> Answer:
    from srs_opt.judge.replay import load_motion, replay
    from srs_opt.judge.settings import EngineSettings
    from srs_opt.judge.walls import solid_region

    motion = load_motion(options.file)
    walls = solid_region(motion["maze"])
    settings = EngineSettings(options.step)
    return _beside(options, robot, "drive", lambda: replay(robot, motion, settings), walls)


def _manoeuvre(options: argparse.Namespace, robot: Robot) -> Answer:
    from srs_opt.judge.manoeuvres import load_manoeuvre, replay_manoeuvre
    from srs_opt.judge.settings import EngineSettings

    asked = (*load_manoeuvre(options.file, robot), chosen_model(options, robot), EngineSettings(options.step))
    return _beside(options, robot, "manoeuvre", lambda: replay_manoeuvre(robot, *asked), None)


def _beside(
    options: argparse.Namespace, robot: Robot, key: str, play: Callable[[], Replay | Played], walls: Any
) -> Answer:
    """Play a motion, write it beside ours."""
    import time

    from srs_opt.files import write_json
    from srs_opt.judge.figures import draw_replay

    begun = time.perf_counter()
    seen = play()
    seconds = round(time.perf_counter() - begun, 3)
    answer = {key: seen.to_record(), "robot": robot.name, "seconds": seconds}
    files = [
        write_json(options.out / "judge.json", answer),
        *draw_replay(seen, walls, robot.body_width_m, options.out / "judge"),
    ]
    return Answer(answer, seen.in_words(), seen.agrees, tuple(files))


def _gaits(options: argparse.Namespace, robot: Robot, tolerance: AgreementSettings) -> Answer:
    import shutil
    import time

    from srs_opt.files import write_json
    from srs_opt.judge.cases import cases_of
    from srs_opt.judge.figures import draw_opinions
    from srs_opt.judge.opinion import opinions
    from srs_opt.judge.settings import EngineSettings
    from srs_opt.parallel.sweep import Resume

    model, settings = chosen_model(options, robot), EngineSettings(options.step)
    cases = cases_of(options.file, robot, options.pressure, options.refine, options.seed)
    unfinished = options.out / "judge.unfinished"  # an interrupted run goes on from here
    begun = time.perf_counter()
    found = opinions(
        robot, cases, model, settings, tolerance, jobs=options.jobs, cluster=options.cluster,
        quiet=options.quiet, engine=options.engine,
        resume=Resume(unfinished, f"{options.engine} {robot.fingerprint()} {model} {settings}"),
    )  # fmt: skip
    shutil.rmtree(unfinished, ignore_errors=True)
    answer = {
        "gaits": [opinion.to_record() for opinion in found],
        "agree": sum(opinion.agrees for opinion in found),
        "engine": options.engine,
        "tolerance": tolerance.to_record(),
        "robot": robot.name,
        "model": model,
        "seconds": round(time.perf_counter() - begun, 3),
    }
    files = [
        write_json(options.out / "judge.json", answer),
        *draw_opinions(found, options.out / "judge"),
    ]
    return Answer(answer, _table(found), all(opinion.agrees for opinion in found), tuple(files))


def _table(found: list[Opinion]) -> str:
    """Return the opinions as lines; of many, those that disagree and the first."""
    shown = sorted(found, key=lambda o: o.agrees)[:SHOWN] if len(found) > SHOWN else found
    width = max(len(o.name) for o in shown)
    lines = [f"{o.name:{width}s}  {o.in_words()}" for o in shown]
    if len(found) > len(shown):
        lines.append(f"… and {len(found) - len(shown)} more that agree")
    if len(found) > 1:
        lines.append(f"{sum(o.agrees for o in found)} of {len(found)} gaits agree")
    return "\n".join(lines)


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    sys.exit(main())

"""``plan MAZE``: a certified way through a maze for the whole undulating robot, driven if asked."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from srs_opt.command import Answer, Parser, finite_float, make_parser, positive_float, run_command, say

if TYPE_CHECKING:
    from planners.drive.execute import Execution
    from planners.plan.answer import PlanResult
    from planners.search.problem import Problem
    from srs_opt.robot import Robot

COSTS = ("time", "length", "clearance", "air")
MARGIN_M = 0.005


def build_parser() -> Parser:
    """Return the command's parser."""
    parser = make_parser(
        "plan",
        "Find a way through a maze for the whole body of the robot, choosing a gait for every cycle.\n"
        "Every plan is certified: played afresh on the dynamic model, body against exact walls.\n"
        "Lengths in m, angles in rad, times in s. Exit status 1: no way (and why).",
        "plan mazes/first.yaml --execute --animate out/first.gif",
    )
    add_planning_options(parser)
    parser.add_argument(
        "--refine",
        action="store_true",
        help="then optimize all valve switches, cycle times and pressures at once for less time; certified "
        "afresh, the plan is kept where that fails (takes up to 5 s per second of plan)",
    )
    parser.add_argument(
        "--execute", action="store_true", help="drive the plan closed-loop on the dynamic model"
    )
    parser.add_argument(
        "--true-robot", type=Path, metavar="FILE", help="drive this robot instead (implies --execute)"
    )
    parser.add_argument(
        "--judge",
        action="store_true",
        help="also drive it closed-loop with another physics engine as the robot (extra 'judge')",
    )
    parser.add_argument("--ros-path", type=Path, metavar="FILE", help="also write a nav_msgs/Path as YAML")
    parser.add_argument("--animate", type=Path, metavar="FILE", help="animation, .gif or (with ffmpeg) .mp4")
    return parser


def add_planning_options(parser: Parser) -> None:
    """Add the maze, and everything that decides how the way through it is planned."""
    parser.add_argument(
        "maze", metavar="MAZE", help="our YAML, ROS map YAML, MovingAI, micromouse, BARN .world"
    )
    add_problem_options(parser)
    parser.add_argument(
        "--planner",
        type=str.lower,
        default="auto",
        metavar="NAME",
        help="auto (default, a portfolio), lattice, fine, one of OMPL's (rrt, est, kpiece1; dubins-NAME and "
        "rs-NAME for a route of its geometric planners), or one that a --plugin registers",
    )
    parser.add_argument(
        "--best", action="store_true", help="go on looking for better plans until the time limit"
    )
    parser.add_argument(
        "--time-limit", type=positive_float, default=60.0, metavar="S", help="guard, s (default %(default)g)"
    )


def add_problem_options(parser: Parser) -> None:
    """Add everything but the maze that decides what has to be planned."""
    from planners.plan.options import goal_option, pose_option

    parser.add_argument(
        "--gaits", type=Path, metavar="FILE", help="gait table (default: the one built for this robot)"
    )
    parser.add_argument("--start", type=pose_option, metavar="X,Y,HEADING", help="in place of the maze's")
    parser.add_argument("--goal", type=goal_option, metavar="X,Y[,RADIUS]", help="in place of the maze's")
    parser.add_argument(
        "--cell", type=positive_float, metavar="M", help="cell size of formats that have none, m"
    )
    parser.add_argument(
        "--scale", type=positive_float, default=1.0, metavar="S", help="factor on the maze's lengths"
    )
    parser.add_argument(
        "--unknown",
        choices=("wall", "free"),
        default="wall",
        help="what unknown cells of a map are taken for (default wall)",
    )
    parser.add_argument(
        "--margin",
        type=finite_float,
        default=MARGIN_M,
        metavar="M",
        help="clearance that the body keeps from walls, m (default %(default)g)",
    )
    parser.add_argument(
        "--drive",
        type=Path,
        metavar="FILE",
        help="drive.json of a drive calibrated by measured maps: its factors bend every cycle, its "
        "uncertainty is room that every cycle keeps",
    )
    parser.add_argument(
        "--min-dwell",
        type=positive_float,
        default=0.02,
        metavar="S",
        help="least time between two switches of one segment, across changes of gait too, s (default "
        "%(default)g)",
    )
    parser.add_argument(
        "--tick",
        type=positive_float,
        default=0.001,
        metavar="S",
        help="controller's tick, s (default %(default)g)",
    )
    parser.add_argument(
        "--pressure-rate",
        type=positive_float,
        metavar="KPA_S",
        help="of the regulator, kPa/s (default: every change takes 0.1 s)",
    )
    parser.add_argument(
        "--cost", choices=COSTS, default="time", help="what the plan shall have little of (default time)"
    )


def run(options: argparse.Namespace) -> Answer:
    """Plan, certify, explain, drive, draw."""
    from dataclasses import replace
    from functools import partial

    from planners.drive.engine_plant import drive_in_engine
    from planners.plan.inputs import problem_from
    from planners.plan.looks import looks
    from planners.plan.portfolio import Wish, solve
    from planners.plan.registry import planner_named
    from planners.refine.refine import check_refinable, refine
    from planners.view.animation_path import check_animation_path
    from srs_opt.files import write_json
    from srs_opt.judge.bodies import check_judge
    from srs_opt.robot import load_robot

    if options.animate:
        check_animation_path(options.animate)  # before any work
    if options.planner != "auto":
        planner_named(options.planner)
    true_robot = load_robot(options.true_robot) if options.true_robot else None
    if options.judge:
        check_judge([true_robot or load_robot(options.robot)])
    problem = problem_from(options)
    if options.refine:
        check_refinable(problem)
    wish = Wish(options.planner, options.seed, options.time_limit, options.best)
    result = solve(problem, wish, lambda message: say(options, message))
    record = result.to_record(problem)
    files: list[Path] = []
    execution = None
    if result.plan is None:
        files += _explain(options, problem, result, record)
    else:
        plan = result.plan
        if options.refine:
            refined = refine(problem, plan, lambda message: say(options, message))
            problem, plan = refined.problem, refined.plan
            result = replace(result, plan=plan)
            record = result.to_record(problem) | {"refined": refined.to_record()}
        between = looks(problem, plan)
        record["looks"] = between.to_record()
        execution = _drive(options, problem, result, record, true_robot)
        if options.judge:
            say(options, "driving in the other engine")
            told = partial(say, options)
            record["judge"] = drive_in_engine(problem, plan, true_robot, told).to_record()
        files += _pictures(options, problem, result, execution)
    files.append(write_json(options.out / "plan.json", record))
    good = result.plan is not None and (execution is None or execution.reached)
    good = good and record.get("judge", {}).get("agrees", True)
    words = _summary(record, None if result.plan is None else between.in_words())
    return Answer(record, words, good, tuple(files))


def _explain(
    options: argparse.Namespace, problem: Problem, result: PlanResult, record: dict[str, Any]
) -> list[Path]:
    """Say why there is no way, in the record and as a picture."""
    from planners.plan.explain import explain
    from planners.view.obstruction import save_obstruction_picture

    explanation = explain(problem)
    record["reason"] = explanation.in_words(result.reason)
    record["tightest"] = explanation.to_record()
    return [*save_obstruction_picture(options.out / "why_not", problem, explanation)]


def _drive(
    options: argparse.Namespace,
    problem: Problem,
    result: PlanResult,
    record: dict[str, Any],
    true_robot: Robot | None,
) -> Execution | None:
    """Drive the plan if asked to, and record how it went."""
    from planners.drive.execute import execute

    if not (options.execute or true_robot) or result.plan is None:
        return None
    execution = execute(problem, result.plan, true_robot, lambda message: say(options, message))
    record["execution"] = execution.to_record()
    return execution


def _pictures(
    options: argparse.Namespace, problem: Problem, result: PlanResult, execution: Execution | None
) -> list[Path]:
    from planners.plan.program import plan_program
    from planners.plan.ros_path import save_ros_path
    from planners.view.animate import save_animation
    from planners.view.picture import save_plan_picture
    from planners.view.record import save_motion
    from srs_opt.controller.c_source import write_program

    assert result.plan is not None  # the caller has looked
    driven = None if execution is None else execution.pose[:, :2]
    files = [*save_plan_picture(options.out / "plan", problem, result.plan, driven)]
    files.append(save_motion(options.out / "motion.json", problem, result.plan, execution))
    if options.ros_path:
        files.append(save_ros_path(result.plan, options.ros_path))
    files.append(write_program(plan_program(problem, result.plan), options.out / "plan_program.h"))
    if options.animate:
        files.append(save_animation(options.animate, problem, result.plan, execution))
    return files


def _summary(record: dict[str, Any], between: str | None) -> str:
    """Return the answer in words."""
    if record["status"] != "solved":
        return f"{record['status']}: {record['reason']} ({record['planning_s']:.2f} s)"
    lines = [
        f"solved by {record['planner']} in {record['planning_s']:.2f} s{_refinement(record)}: "
        f"{record['length_m']:.2f} m, "
        f"{record['duration_s']:.1f} s, {sum(s['cycles'] for s in record['steps'])} cycles, clearance "
        f"at least {1e3 * record['clearance_m']:.1f} mm, certified"
    ]
    if between is not None:
        lines.append(between)
    if execution := record.get("execution"):
        lines.append(
            f"driven: {execution['reason']}; {execution['duration_s']:.1f} s, "
            f"smallest clearance {1e3 * execution['smallest_clearance_m']:.1f} mm, "
            f"{execution['replans']} new plans on the way"
        )
    if judge := record.get("judge"):
        lines.append(
            f"judge: {'agrees' if judge['agrees'] else 'DISAGREES'}: in the other engine {judge['reason']}; "
            f"{judge['duration_s']:.1f} s, {judge['contacts']} contacts, smallest clearance "
            f"{1e3 * judge['smallest_clearance_m']:.1f} mm, {judge['replans']} new plans on the way"
        )
    return "\n".join(lines)


def _refinement(record: dict[str, Any]) -> str:
    """Return what was made of the plan, in words."""
    refined = record.get("refined")
    if refined is None:
        return ""
    if refined["kept"]:
        return f" (kept as found: {refined['kept']})"
    return f" (refined from {refined['from_s']:.1f} s of way in {refined['seconds']:.0f} s)"


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    raise SystemExit(main())

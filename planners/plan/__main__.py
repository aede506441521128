"""``plan MAZE``: a certified way through a maze for the whole undulating robot, driven if asked."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from srs_opt.command import (
    Answer,
    Parser,
    chosen_model,
    finite_float,
    make_parser,
    positive_float,
    run_command,
    say,
)

if TYPE_CHECKING:
    from planners.apps.route import Route
    from planners.drive.execute import Execution

COSTS = ("time", "length", "clearance", "air")


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
        "afresh, the plan is kept where that fails (takes about 3 s per second of plan)",
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
        help="auto (default, a portfolio), lattice, runs, fine, one of OMPL's (rrt, est, kpiece1; "
        "dubins-NAME and rs-NAME for a route of its geometric planners), or one that a --plugin registers",
    )
    parser.add_argument(
        "--best", action="store_true", help="go on looking for better plans until the time limit"
    )
    parser.add_argument(
        "--time-limit", type=positive_float, default=60.0, metavar="S", help="guard, s (default %(default)g)"
    )


def add_problem_options(parser: Parser) -> None:
    """Add everything but the maze that decides what has to be planned."""
    from planners.plan.options import MARGIN_M, goal_option, pose_option

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
    from functools import partial

    from planners.apps.route import Route, drive_plan
    from planners.drive.engine_plant import drive_in_engine
    from planners.plan.inputs import problem_from
    from planners.plan.portfolio import PlanRequest, solve
    from planners.plan.registry import planner_named
    from planners.refine.refine import check_refinable
    from planners.view.animation_path import check_animation_path
    from srs_opt.figures import save_figure
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
    if options.refine:
        robot = load_robot(options.robot)
        model = chosen_model(options, robot)
        check_refinable(robot, model, cost=options.cost, calibrated=options.drive is not None)
    problem = problem_from(options)
    request = PlanRequest(options.planner, options.seed, options.time_limit, options.best)
    route = Route(problem, solve(problem, request, lambda message: say(options, message)))
    if options.refine and route.solved:
        route = route.refined(lambda message: say(options, message))
    words = [route.in_words()]
    record = route.to_dict()
    good, execution = route.solved, None
    if route.solved:
        words.append(route.looks.in_words())
        if options.execute or true_robot:
            driven = drive_plan(route, true_robot, lambda message: say(options, message))
            execution, record["execution"] = driven.execution, driven.to_dict()
            words.append(driven.in_words())
            good = good and execution.reached
        if options.judge:
            say(options, "driving in the other engine")
            judged = drive_in_engine(route.problem, route.plan, true_robot, partial(say, options)).to_record()
            record["judge"] = judged
            words.append(_judge_words(judged))
            good = good and judged["agrees"]
        files = _pictures(options, route, execution)
    else:
        files = [*save_figure(route.figure(), options.out / "why_not")]
    files.append(write_json(options.out / "plan.json", record))
    return Answer(record, "\n".join(words), good, tuple(files))


def _pictures(options: argparse.Namespace, route: Route, execution: Execution | None) -> list[Path]:
    from planners.plan.program import plan_program
    from planners.plan.ros_path import save_ros_path
    from planners.view.animate import save_animation
    from planners.view.picture import plan_figure
    from planners.view.record import save_motion
    from srs_opt.controller.c_source import write_program
    from srs_opt.figures import save_figure

    problem, plan = route.problem, route.plan
    files = [*save_figure(plan_figure(problem, plan, execution), options.out / "plan")]
    files.append(save_motion(options.out / "motion.json", problem, plan, execution))
    if options.ros_path:
        files.append(save_ros_path(plan, options.ros_path))
    files.append(write_program(plan_program(problem, plan), options.out / "plan_program.h"))
    if options.animate:
        files.append(save_animation(options.animate, problem, plan, execution))
    return files


def _judge_words(judge: dict[str, Any]) -> str:
    """Return the other engine's drive in words."""
    return (
        f"judge: {'agrees' if judge['agrees'] else 'DISAGREES'}: in the other engine {judge['reason']}; "
        f"{judge['duration_s']:.1f} s, {judge['contacts']} contacts, smallest clearance "
        f"{1e3 * judge['smallest_clearance_m']:.1f} mm, {judge['replans']} new plans on the way"
    )


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    raise SystemExit(main())

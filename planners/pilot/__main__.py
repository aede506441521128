"""``python -m planners.pilot MAZE``: plan, then drive the real robot through the maze, closed-loop."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from planners.plan.__main__ import add_planning_options
from srs_opt.command import Answer, Parser, make_parser, positive_float, positive_int, run_command, say

if TYPE_CHECKING:
    from planners.pilot.session import PilotedDrive
    from planners.plan.answer import Plan
    from planners.search.problem import Problem

BAUD = 115_200


def build_parser() -> Parser:
    """Return the command's parser."""
    parser = make_parser(
        "python -m planners.pilot",
        "Plan a way through a maze and drive the robot along it: commands over the line to its valve\n"
        "controller, poses from its cameras. Vents on lost pose, stray, contact risk and Ctrl-C.\n"
        "Exit status 1: no way, or the drive did not arrive (and why).",
        "python -m planners.pilot mazes/first.yaml --valves /dev/ttyACM0 --pose udp://0.0.0.0:5005",
    )
    add_planning_options(parser)
    parser.add_argument("--valves", required=True, metavar="PORT", help="serial port of the valve controller")
    parser.add_argument(
        "--baud", type=positive_int, default=BAUD, metavar="N", help="its speed (default %(default)d)"
    )
    parser.add_argument(
        "--pose",
        required=True,
        metavar="SOURCE",
        help="udp://HOST:PORT (JSON lines), natnet://GROUP:PORT (rigid bodies 1 to N), ros2://TOPIC",
    )
    parser.add_argument(
        "--slow-motion",
        type=positive_float,
        default=1.0,
        metavar="X",
        help="everything X times slower, to practise with virtual_lab.robot --slow-motion X (default 1)",
    )
    parser.add_argument(
        "--page",
        type=int,
        metavar="PORT",
        help="serve a live page with a stop button on http://127.0.0.1:PORT (0: any free port)",
    )
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Plan, connect, drive, write."""
    from planners.motion.valves import playable
    from planners.pilot.hardware import MachineClock, open_port
    from planners.pilot.page import LivePage
    from planners.pilot.session import pilot
    from planners.pilot.sources import open_source
    from planners.plan.inputs import gaits_from, problem_from, valve_limits
    from planners.plan.portfolio import PlanRequest, solve
    from srs_opt.controller.program import Program

    clock = MachineClock(options.slow_motion)
    port = open_port(options.valves, options.baud)
    problem = problem_from(options)
    source = open_source(options.pose, problem.robot, clock, lambda message: say(options, message))
    try:
        request = PlanRequest(options.planner, options.seed, options.time_limit, options.best)
        result = solve(problem, request, lambda message: say(options, message))
        record = result.to_record(problem)
        if result.plan is None:
            return Answer(record, f"{result.status}: {result.reason}", False)
        # the header that is flashed has the driver's gaits too, behind those of the plan
        table = playable(problem.robot, gaits_from(options, problem.robot), valve_limits(options))
        program = Program.of_table(table, options.tick)
        with LivePage.serve(options.page, problem, result.plan, lambda text: say(options, text)) as page:
            driven = pilot(
                problem,
                result.plan,
                program,
                port,
                source,
                clock,
                lambda message: say(options, message),
                page.show,
            )
    finally:
        source.close()
        port.close()
    record["execution"] = driven.execution.to_record()
    record["latency_s"] = round(driven.latency.value_s, 5)
    files = _files(options.out, problem, result.plan, driven, record)
    return Answer(record, _summary(driven), driven.execution.reached, files)


def _files(
    out: Path, problem: Problem, plan: Plan, driven: PilotedDrive, record: dict[str, object]
) -> tuple[Path, ...]:
    from planners.pilot.record import write_dataset
    from planners.view.picture import plan_figure
    from planners.view.record import save_motion
    from srs_opt.figures import save_figure
    from srs_opt.files import write_json

    execution = driven.execution
    return (
        *save_figure(plan_figure(problem, plan, execution), out / "plan"),
        save_motion(out / "motion.json", problem, plan, execution),
        write_dataset(driven.log, out / "dataset", problem.robot, driven.latency.value_s),
        write_json(out / "pilot.json", record),
    )


def _summary(driven: PilotedDrive) -> str:
    e, line = driven.execution, driven.line
    return (
        f"driven: {e.reason}; {e.duration_s:.1f} s, {len(e.gaits)} cycles, smallest clearance "
        f"{1e3 * e.smallest_clearance_m:.1f} mm (estimated), {e.replans} new plans on the way\n"
        f"poses {1e3 * driven.latency.value_s:.0f} ms late, predictions corrected by up to "
        f"{1e3 * driven.offset_m:.1f} mm; line: round trip {1e3 * line.round_trip_s:.0f} ms, "
        f"{line.repeats} of {line.commands} commands repeated"
    )


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    raise SystemExit(main())

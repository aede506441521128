"""``python -m srs_opt.manoeuvre``: the best valve switching from a state to a state."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from srs_opt.command import (
    Answer,
    Parser,
    add_valve_limits,
    chosen_model,
    finite_float,
    make_parser,
    positive_float,
    positive_int,
    run_command,
    say,
    seed_number,
)

if TYPE_CHECKING:
    from srs_opt.gait import Gait
    from srs_opt.gait_opt.table import GaitTable
    from srs_opt.manoeuvre.task import Task
    from srs_opt.robot import Robot
    from srs_opt.simulate.integrate import Integrator


def build_parser() -> Parser:
    """Return the command's options."""
    parser = make_parser(
        "python -m srs_opt.manoeuvre",
        "Find the valve switching that takes the robot from a state to a state in least time, with least\n"
        "air or in least space. It starts straight and at rest (or in a gait: --from) at the origin,\n"
        "heading along x. What the end must be: any of --past, --turn, --pose, --rest, --to.\n"
        "Lengths in m, angles in rad. Exit status 1: nothing found, or the certificate failed.",
        "python -m srs_opt.manoeuvre --past 1",
    )
    add = parser.add_argument
    gait = "gait of gait_opt (JSON), TABLE.json:NAME, or the NAME of a gait in the robot's table"
    add("--from", dest="begin", metavar="GAIT", help=f"start in this steady gait: {gait} (default: at rest)")
    add(
        "--past", type=finite_float, metavar="M", help="end: the centre of mass is so far ahead (< 0: behind)"
    )
    add("--turn", type=finite_float, metavar="RAD", help="end: the mean heading has turned so far, + left")
    add(
        "--pose",
        type=finite_float,
        nargs=3,
        metavar=("X", "Y", "HEADING"),
        help="end: centre of mass and mean heading, within 2 mm and 0.01 rad",
    )
    add("--rest", action="store_true", help="end: at rest, vented and straight")
    add("--to", metavar="GAIT", help="end: in this steady gait, at its time 0, which goes on from there")
    add("--within", type=positive_float, metavar="M", help="the centre of mass stays so near to its start")
    add(
        "--space", metavar="FILE", help="room that the whole body keeps to: YAML with a polygon or a corridor"
    )
    add(
        "--objective",
        choices=("time", "air", "space"),
        default="time",
        help="what shall be least (default time)",
    )
    add("--longest", type=positive_float, metavar="S", help="time allowed where it is not the objective, s")
    add(
        "--pressure",
        type=positive_float,
        nargs=2,
        default=(25.0, 55.0),
        metavar=("LO", "HI"),
        help="limits of the one pressure, kPa (default 25 55); a gait at start or end sets it",
    )
    add_valve_limits(parser)
    add("--starts", type=positive_int, default=8, metavar="N", help="starts that are optimized (default 8)")
    add(
        "--populations",
        type=seed_number,
        default=2,
        metavar="N",
        help="populations of waves that change on the way, 10 to 30 s each (default 2)",
    )
    add("--shakes", type=seed_number, default=24, metavar="N", help="perturbed optima tried (default 24)")
    return parser


def run(options: argparse.Namespace) -> Answer:
    """Search, certify, write."""
    from srs_opt.controller.c_source import write_program
    from srs_opt.errors import InputError
    from srs_opt.files import write_json
    from srs_opt.manoeuvre.export import draw_manoeuvre, program_of, record_of
    from srs_opt.manoeuvre.search import find
    from srs_opt.orbit.body import integrator
    from srs_opt.robot import load_robot
    from srs_opt.simulate.export import write_trajectory
    from srs_opt.simulate.valve_file import write_valves

    robot = load_robot(options.robot)
    model = chosen_model(options, robot)
    if model == "compliant":
        raise InputError(
            "manoeuvres are not optimized on the compliant model: give --model complex or simplified"
        )
    run = integrator(robot.with_values(valve_delay_s=0.0), model)
    run.check_played_once()  # before any gaits are optimized
    task = _task(options, run, robot, model)
    gaits = [entry.gait for entry in _table(options, robot, model).gaits]
    found = find(
        run,
        task,
        gaits,
        options.starts,
        options.populations,
        options.shakes,
        options.seed,
        lambda text: say(options, text),
    )
    record = record_of(run, task, found)
    files = [write_json(options.out / "manoeuvre.json", record)]
    files.append(write_valves(found.plan.timeline(), options.out / "valves.csv"))
    files.append(write_program(program_of(robot, task, found), options.out / "manoeuvre_program.h"))
    files.append(write_trajectory(found.trajectory, options.out / "trajectory.csv"))
    files += draw_manoeuvre(run, task, found, options.out / "manoeuvre")
    return Answer(
        record, _words(record, found.certificate.failures()), found.certificate.passed, tuple(files)
    )


def _task(options: argparse.Namespace, run: Integrator, robot: Robot, model: str) -> Task:
    from srs_opt.errors import InputError
    from srs_opt.manoeuvre.space import load_space
    from srs_opt.manoeuvre.task import End, Start, Task, ValveBounds
    from srs_opt.orbit.steady import steady_gait

    bounds = ValveBounds(tuple(options.pressure), options.min_dwell, options.tick, options.max_curvature)
    wanted = (options.past, options.turn, options.pose, options.to)
    if not options.rest and all(w is None for w in wanted):
        raise InputError("say what the end must be: --past, --turn, --pose, --rest or --to")
    space = load_space(options.space) if options.space else None
    after = None
    if options.to:
        after = steady_gait(robot, _on_ticks(options, _gait(options, options.to, robot, model)), model)
    end = End(
        options.past,
        options.turn,
        tuple(options.pose) if options.pose else None,
        options.within,
        options.rest,
        after,
    )
    start = Start.at_rest(run)
    if options.begin:
        start = Start.in_gait(run, robot, _on_ticks(options, _gait(options, options.begin, robot, model)))
    pressures = {gait.pressure_kpa for gait in (start.gait, after.gait if after else None) if gait}
    if len(pressures) > 1 and not run.actuator.linear:
        raise InputError("effects make the actuators nonlinear: both gaits must have the same pressure")
    return Task(start, end, options.objective, space, bounds, options.longest)


def _on_ticks(options: argparse.Namespace, gait: Gait) -> Gait:
    """Return a gait as the controller plays it."""
    return gait.on_ticks(options.tick)


def _table(options: argparse.Namespace, robot: Robot, model: str) -> GaitTable:
    from srs_opt.gait_opt.catalogue import default_table

    return default_table(robot, model, say=lambda text: say(options, text))


def _gait(options: argparse.Namespace, name: str, robot: Robot, model: str) -> Gait:
    from srs_opt.gait import check_gait
    from srs_opt.gait_file import load_gait

    if "." not in name and ":" not in name:
        entries = {entry.name: entry.gait for entry in _table(options, robot, model).gaits}
        if name in entries:
            return entries[name]
    gait = load_gait(name, options.pressure[1])
    check_gait(robot, gait)
    return gait


def _words(record: dict[str, Any], failures: str) -> str:
    end = record["end"]
    trust = "certificate: passed" if not failures else f"certificate FAILED: {failures}"
    return (
        f"{record['duration_s']:.3f} s at {record['pressure_kpa']:.2f} kPa with {record['fills']} fills; "
        f"ends at x {end['x_m']:.4f} m, y {end['y_m']:.4f} m, heading {end['heading_rad']:+.4f} rad, "
        f"{end['speed_m_s']:.3f} m/s; {trust}"
    )


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    sys.exit(main())

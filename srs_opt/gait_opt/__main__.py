"""``python -m srs_opt.gait_opt``: optimal gaits for on/off valves, with a certificate; gait tables."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
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
    progress,
    run_command,
    say,
)
from srs_opt.errors import InputError
from srs_opt.gait_opt.table_settings import TABLE

if TYPE_CHECKING:
    from srs_opt.gait_opt.collocation.problem import CycleProblem
    from srs_opt.gait_opt.goal import Limits
    from srs_opt.robot import Robot

MOST_INTERVALS = 8  # more would have to be shorter than a valve can follow


def build_parser() -> Parser:
    """Return the command's options."""
    parser = make_parser(
        "python -m srs_opt.gait_opt",
        "Find the best periodic valve timing by direct collocation; certify it by switch-exact simulation.",
        "python -m srs_opt.gait_opt --objective turn --radius 0.3 --pressure 41 55",
        sweep=True,
    )
    goal = parser.add_argument_group("what is wanted")
    goal.add_argument(
        "--objective", default="speed", metavar="NAME",
        help="speed: fastest; transport: least energy per weight and distance; turn: tightest turn or, with "
        "--radius or --turn-rate, the fastest such; pivot: most turn rate; slim: slimmest swept band; or one "
        "that a --plugin defines (default speed)",
    )  # fmt: skip
    goal.add_argument("--speed", type=positive_float, metavar="M_S", help="wanted (least) speed, m/s")
    goal.add_argument(
        "--least-speed", type=positive_float, metavar="M_S",
        help="slowest gait to be taken, m/s (default 0.02 for transport, turn and slim, else none)",
    )  # fmt: skip
    goal.add_argument(
        "--side", choices=("left", "right"), default="left",
        help="where a tightest turn or a pivot goes (default left)",
    )  # fmt: skip
    goal.add_argument("--radius", type=finite_float, metavar="M", help="wanted radius, m, + left")
    goal.add_argument(
        "--turn-rate", type=finite_float, metavar="RAD_S", help="wanted turn rate, rad/s, + left"
    )
    goal.add_argument("--envelope", type=positive_float, metavar="M", help="widest swept band, m")
    goal.add_argument("--table", action="store_true", help="build the gait table: JSON, CSV and C header")
    goal.add_argument(
        "--quick",
        action="store_true",
        help="with --table: few gaits in about a minute (fast, slim, two radii and their images)",
    )
    _add_limits(parser)
    how = parser.add_argument_group("how")
    how.add_argument(
        "--valves", choices=("wave", "free"), default="wave", help="family of gaits (default wave)"
    )
    how.add_argument(
        "--intervals", type=positive_int, default=1, metavar="K", help="on-intervals, --valves free"
    )
    how.add_argument(
        "--robots", type=Path, nargs="+", metavar="FILE", help="one gait for all of these robots"
    )
    how.add_argument(
        "--solver", choices=("ipopt", "fatrop", "sqpmethod"), default="ipopt",
        help="of the nonlinear programs (default ipopt, for which the search is made)",
    )  # fmt: skip
    how.add_argument(
        "--solver-option", action="append", default=[], metavar="KEY=VALUE",
        help="an option of the solver's own, as max_iter=500 (repeat for several)",
    )  # fmt: skip
    how.add_argument(
        "--stiffness", type=positive_float, nargs="+", metavar="EI",
        help="one gait for all of these bending stiffnesses, N m^2 (for example 0.002 0.005 0.02)",
    )  # fmt: skip
    how.add_argument(
        "--spread", type=positive_float, metavar="SHARE",
        help="for actuators too whose curvature per pressure or time constants are off by this share (0.1), "
        "on the softest and the stiffest body",
    )  # fmt: skip
    how.add_argument(
        "--worst", choices=("relative", "absolute"),
        help="which of several robots counts: the slowest beside its published gait (default where speed is "
        "wanted), or the slowest",
    )  # fmt: skip
    how.add_argument("--starts", type=positive_int, default=4, metavar="N", help="starting gaits (default 4)")
    how.add_argument(
        "--judge",
        action="store_true",
        help="ask another physics engine about the result (extra 'judge'); the certificate carries its word",
    )
    how.add_argument(
        "--warm",
        metavar="FILE",
        help="start from an earlier run's gait.json; with --table, its gait_table.json on this --tick",
    )
    return parser


def _add_limits(parser: Parser) -> None:
    group = parser.add_argument_group("limits")
    add = group.add_argument
    add(
        "--frequency",
        nargs=2,
        type=positive_float,
        default=(1.0, 2.0),
        metavar=("LO", "HI"),
        help="Hz (default 1 2)",
    )
    add(
        "--pressure",
        nargs=2,
        type=finite_float,
        metavar=("LO", "HI"),
        help="kPa (default 41 55; for --table 20 55)",
    )
    add_valve_limits(group)
    add("--valve-delay", type=finite_float, metavar="S", help="instead of the robot's own, s")
    add(
        "--chamber-volume",
        type=positive_float,
        metavar="M3",
        help="air per fill, m^3 (default: a bore of 1/6 body width)",
    )


def problem_from(options: argparse.Namespace) -> CycleProblem:
    """Return the problem that the options describe."""
    from srs_opt.gait_opt.collocation.problem import CycleProblem
    from srs_opt.gait_opt.collocation.solver import Solver
    from srs_opt.gait_opt.goal import Goal
    from srs_opt.gait_opt.robust import relative, spread
    from srs_opt.robot import load_robot

    robots: list[Robot] = [load_robot(path) for path in options.robots or [options.robot]]
    if options.valve_delay is not None:
        robots = [r.with_values(valve_delay_s=options.valve_delay) for r in robots]
    goal = Goal(
        options.objective, options.speed, options.radius, options.turn_rate, options.envelope,
        options.least_speed, options.side,
    )  # fmt: skip
    robots = softened(options, robots)
    if options.spread:
        if options.spread >= 1:
            raise InputError(f"--spread must be below 1, found {options.spread:g}")
        robots = spread(robots, options.spread)
    if options.intervals > 1 and options.valves != "free":
        raise InputError("--intervals goes with --valves free: a wave has one interval per segment and cycle")
    if options.intervals > MOST_INTERVALS:
        raise InputError(f"--intervals {options.intervals}: at most {MOST_INTERVALS} on-intervals per cycle")
    if options.warm and options.valves == "free":
        raise InputError("--warm goes with --valves wave")
    problem = CycleProblem(
        tuple(robots),
        chosen_model(options, robots[0]),
        goal,
        limits_from(options),
        options.intervals,
        solver=Solver.of_words(options.solver, options.solver_option),
    )
    if options.worst == "relative" and not goal.merit_is_speed:
        raise InputError("--worst relative compares speeds: use it with objective speed, or turn on a radius")
    if len(robots) > 1 and goal.merit_is_speed and options.worst != "absolute":
        return relative(problem)
    return problem


def softened(options: argparse.Namespace, robots: list[Robot]) -> list[Robot]:
    """Return the robots with the stiffnesses that are asked for, or that a robot's file leaves open."""
    from srs_opt.gait_opt.robust import of_stiffness, stiffness_interval

    if options.stiffness:
        if options.robots:
            raise InputError("give --stiffness EI... or --robots FILE..., not both")
        if options.model not in (None, "compliant"):
            raise InputError(f"--stiffness goes with --model compliant, not with {options.model}")
        return [of_stiffness(robots[0], ei) for ei in options.stiffness]
    soft = [r for r in robots if r.is_soft]
    if options.model is None and soft and len(soft) < len(robots):
        rigid = next(r for r in robots if not r.is_soft)
        raise InputError(
            f"robot '{rigid.name}' is rigid and '{soft[0].name}' is soft: give all of them a "
            "bending_stiffness_n_m2, or choose a model with --model complex"
        )
    if len(robots) == 1 and options.model in (None, "compliant"):
        return list(stiffness_interval(robots[0]))
    return robots


def limits_from(options: argparse.Namespace) -> Limits:
    """Return the limits that the options describe."""
    from srs_opt.gait_opt.goal import Limits

    pressure = options.pressure or (TABLE.pressure_kpa if options.table else (41.0, 55.0))
    return Limits(
        tuple(options.frequency),
        tuple(pressure),
        options.min_dwell,
        options.tick,
        options.max_curvature,
        options.chamber_volume,
    )


def run(options: argparse.Namespace) -> Answer:
    """Optimize, certify, write the files."""
    if options.table:
        return _run_table(options)
    if options.quick:
        raise InputError("--quick goes with --table")
    import shutil
    import time
    from functools import partial

    from srs_opt.figures import save_figure
    from srs_opt.files import write_json
    from srs_opt.gait_file import load_gait
    from srs_opt.gait_opt.figures import convergence_figure
    from srs_opt.gait_opt.free import search_free
    from srs_opt.gait_opt.report import record, summary
    from srs_opt.gait_opt.search import Where, search
    from srs_opt.judge.bodies import check_judge
    from srs_opt.judge.opinion import opinion_on
    from srs_opt.model.parameters import room_effects
    from srs_opt.simulate import compiled

    problem = problem_from(options)
    if len(problem.robots) > 1 and not (options.robots or options.stiffness or options.spread):
        say(
            options,
            f"note: robot '{problem.robots[0].name}' gives its stiffness with a deviation: one gait for two "
            "standard deviations to either side; --stiffness EI for one value alone",
        )
    if options.judge:
        check_judge(problem.robots)
    for robot in problem.robots:
        if effects := room_effects(robot):
            say(
                options,
                f"note: optimized without {', '.join(effects)}: they depend on the place, no gait is steady",
            )
    warm = load_gait(options.warm, problem.limits.pressure_kpa[1]) if options.warm else None
    begun, compiled_before = time.perf_counter(), compiled.compile_seconds
    extra = {}
    unfinished = options.out / "starts.unfinished"  # an interrupted search can go on from here
    where = Where(options.jobs, options.cluster, unfinished)
    asked = problem, options.starts, options.seed, partial(say, options)
    if options.valves == "free":
        freed = search_free(*asked, where=where)
        found, extra = freed.found, {"free": freed.record()}
    else:
        found = search(*asked, warm, where=where)
    if not found.interrupted:
        shutil.rmtree(unfinished, ignore_errors=True)
    compile_s = compiled.compile_seconds - compiled_before
    answer = {**record(problem, found, time.perf_counter() - begun - compile_s, compile_s), **extra}
    good = found.certificate.passed
    if options.judge:
        say(options, "asking the other engine")
        named = [(robot, robot.name, found.gait) for robot in problem.robots]
        opinions = [opinion_on(*each, problem.model) for each in named]
        answer["certificate"]["judge"] = [opinion.to_record() for opinion in opinions]
        good = good and all(opinion.agrees for opinion in opinions)
    files = [
        write_json(options.out / "gait.json", answer),
        *save_figure(found.figure(), options.out / "gait"),
        *save_figure(convergence_figure(found), options.out / "convergence"),
    ]
    return Answer(answer, summary(answer), good, tuple(files))


def _robots_of_table(options: argparse.Namespace) -> tuple[tuple[Robot, ...], str]:
    """Return the robots a table has to serve, the one whose motion it states first, and what to say of it."""
    from srs_opt.gait_opt.any_table import of_any_stiffness, unknown_stiffness, unknown_words
    from srs_opt.gait_opt.robust import in_the_middle
    from srs_opt.robot import load_robot

    robots = softened(options, [load_robot(path) for path in options.robots or [options.robot]])
    asked = options.model or options.stiffness or options.robots or options.warm
    if not asked and unknown_stiffness(robots[0]):
        return of_any_stiffness(robots[0]), f"note: {unknown_words(robots[0])}"
    return in_the_middle(robots) if options.stiffness else tuple(robots), ""


def _run_table(options: argparse.Namespace) -> Answer:
    """Build the gait table and write it as JSON, CSV and C header."""

    if options.spread:
        raise InputError("--spread goes with one robust gait, not with --table")
    if options.quick and options.warm:
        raise InputError("--quick builds a new table: without --warm")
    if options.warm and (options.stiffness or options.robots):
        raise InputError("--table --warm moves one robot's table: without --stiffness and --robots")
    import shutil
    import time
    from functools import partial

    from planners.apps.table_changes import with_changes
    from srs_opt.controller.c_source import write_changes, write_program
    from srs_opt.controller.program import Program
    from srs_opt.figures import save_figure
    from srs_opt.gait_opt.any_table import make_table, usual
    from srs_opt.gait_opt.catalogue import cached_table_path
    from srs_opt.gait_opt.entries import certified_table
    from srs_opt.gait_opt.export import write_csv
    from srs_opt.gait_opt.report import if_soft, robust_words, table_record
    from srs_opt.gait_opt.table import load_table, save_table
    from srs_opt.judge.bodies import check_judge
    from srs_opt.judge.opinion import Case, opinions
    from srs_opt.robot import save_robot

    robots, note = _robots_of_table(options)
    if options.worst and len(robots) == 1:
        raise InputError("--worst says which of several robots counts: give --stiffness or --robots with it")
    robot = robots[0]
    model = chosen_model(options, robot)
    if options.judge:
        check_judge([robot])
    if note:
        say(options, note)
    begun = time.perf_counter()
    limits = limits_from(options)
    unfinished = options.out / "table.unfinished"  # an interrupted table goes on from here
    where: dict[str, Any] = {"jobs": options.jobs, "cluster": options.cluster}
    try:
        if options.warm:
            table = load_table(options.warm, robot)
            table = certified_table(robot, table, limits, partial(say, options), on_other_ticks=True, **where)
        else:
            worst = options.worst or "relative"
            table = make_table(
                robots, model, limits, unfinished, worst, partial(say, options), quick=options.quick, **where
            )
    except KeyboardInterrupt:
        kept = len(list(unfinished.glob("*.json")))
        say(options, f"\n{kept} optimizations are kept in {unfinished}; the same command goes on from there")
        raise
    tell = partial(progress, options=options, what="changes of gait")
    table = with_changes(robot, table, min_dwell_s=options.min_dwell, tick_s=options.tick, progress=tell)
    seconds = time.perf_counter() - begun
    program = Program.of_table(table, options.tick)
    files = [
        save_table(table, options.out / "gait_table.json"),
        write_csv(table, options.out / "gait_table.csv"),
        write_program(program, options.out / "gait_table.h"),
        write_changes(program, table, options.out / "gait_changes.h"),
        *save_figure(table.figure(), options.out / "pareto"),
    ]
    chosen, hint = len(robots) > 1 and not options.warm, ""
    if chosen and not options.robots:  # whose motion the table's is, and how far it may be off
        files.append(save_robot(robot, options.out / "nominal_robot.yaml"))
        hint = f"\n  to plan with it: plan MAZE --robot {files[-1]} --gaits {files[0]}"
    whole = usual(limits) and not (options.warm or options.robots or options.quick)
    if whole:  # then `plan` takes it without being told
        files.append(save_table(table, cached_table_path(robot, model)))
    shutil.rmtree(unfinished, ignore_errors=True)
    answer = table_record(robot, table, limits, seconds)
    words = f"{len(table.gaits)} gaits up to {answer['speed_max_m_s']:.3f} m/s in {seconds:.0f} s"
    if chosen:
        answer["worst_speed_m_s"] = table.gaits[0].worst_speed_m_s
        words += robust_words(table, robots) + hint
    good = True
    if options.judge:
        say(options, "asking the other engine")
        cases = [Case(g.name, g.gait, False) for g in table.gaits]
        found = opinions(robot, cases, model, jobs=options.jobs, cluster=options.cluster, quiet=options.quiet)
        answer["judge"] = [opinion.to_record() for opinion in found]
        agree = sum(opinion.agrees for opinion in found)
        words += f"; the other engine agrees about {agree} of them"
        good = agree == len(found)
    return Answer(answer, "\n".join([words, *if_soft(answer, "the fastest")]), good, tuple(files))


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    return run_command(build_parser(), run, argv)


if __name__ == "__main__":
    sys.exit(main())

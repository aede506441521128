"""``python -m planners.tour``: the whole main job, command by command, as `make run` does it.

It runs the same commands that a person would type, says which, and sums up what came out.
"""

from __future__ import annotations

import argparse
import importlib
import os
import shlex
import sys
import time
from pathlib import Path
from typing import Any

from srs_opt.command import Answer, make_parser, run_command, say

MAZE = Path("mazes/first.yaml")
NEXT_MAZE = "mazes/u_turn.yaml"
ACTIVATE = ".venv/bin/activate"


def _run(module: str, shown: str, arguments: list[str], options: argparse.Namespace) -> tuple[Answer, float]:
    """Run one command in this process; return its answer and how long it took."""
    say(options, f"\n$ {shown} {shlex.join(arguments)}")
    started = time.perf_counter()
    command: Any = importlib.import_module(f"{module}.__main__")
    given = [*arguments, *(["--quiet"] if options.quiet else [])]
    answer: Answer = command.run(command.build_parser().parse_args(given))
    seconds = time.perf_counter() - started
    say(options, f"{answer.summary}  [{seconds:.0f} s]")
    return answer, seconds


def run(options: argparse.Namespace) -> Answer:
    """Do the main job: gait, maps, drive, plan, execution."""
    from srs_opt.errors import InputError

    if not MAZE.exists():
        raise InputError(f"{MAZE}: no such file; run the tour from the project's folder")
    out = options.out
    steps = (
        (
            "srs_opt.gait_opt",
            "python -m srs_opt.gait_opt",
            ["--objective", "speed", "--out", str(out / "gait")],
        ),
        (
            "srs_opt.gait_map",
            "python -m srs_opt.gait_map",
            ["--offset", "0", "0.4", "--out", str(out / "map")],
        ),
        (
            "srs_opt.drive",
            "python -m srs_opt.drive",
            ["--speed", "0.2", "--radius", "0.3", "--out", str(out / "drive")],
        ),
        (
            "planners.plan",
            "plan",
            [
                str(MAZE),
                "--execute",
                "--animate",
                str(out / "plan" / "drive.gif"),
                "--out",
                str(out / "plan"),
            ],
        ),
    )
    answers = [_run(*step, options) for step in steps]
    gait, gaits, drive, plan = (answer for answer, _ in answers)
    if plan.record["status"] == "solved":
        folder = str(out / "plan")
        answers.append(_run("planners.view", "python -m planners.view", [folder, "--out", folder], options))
    record = {
        "gait_opt": gait.record,
        "gait_map": gaits.record,
        "drive": drive.record,
        "plan": plan.record,
        "seconds": sum(seconds for _, seconds in answers),
    }
    files = tuple(path for answer, _ in answers for path in answer.files)
    summary = f"{_summary(record)}\n{_next(out)}"
    return Answer(record, summary, all(answer.good for answer, _ in answers), files)


def _summary(record: dict[str, Any]) -> str:
    gait, gaits, plan = record["gait_opt"], record["gait_map"], record["plan"]
    execution = plan.get("execution") or {}
    baseline = gait["baseline"]["speed_m_s"]
    best = gait["speed_m_s"]
    lines = [
        "",
        f"In {record['seconds']:.0f} s:",
        *_soft(gait["robust_speed_at_stiffness"], "robust gait, whatever the segments' stiffness"),
        f"- fastest gait of a rigid body: {best:.3f} m/s at {gait['frequency_hz']:.2f} Hz and "
        f"{gait['pressure_kpa']:.1f} kPa, {best / baseline:.1f} x the published {baseline:.3f} m/s",
        f"- map of {gaits['points']} gaits: up to {gaits['speed_max_m_s']:.3f} m/s, "
        f"radius down to {gaits['radius_min_m']:.3f} m",
    ]
    lines[-1:-1] = _soft(gait["speed_at_stiffness"], "the same gait on bodies that bend")
    if plan["status"] == "solved":
        lines.append(
            f"- maze {MAZE}: solved by {plan['planner']} in {plan['planning_s']:.2f} s, "
            f"{plan['length_m']:.2f} m in {plan['duration_s']:.1f} s"
        )
    else:
        lines.append(f"- maze {MAZE}: {plan['status']}: {plan['reason']}")
    if execution:
        touched = "without touching a wall" if not execution["collisions"] else "but it touched a wall"
        reached = "reached the goal" if execution["reached"] else "did not reach the goal"
        lines.append(
            f"- driven on the full dynamic model: {reached} {touched}, {execution['duration_s']:.1f} s, "
            f"closest {1000 * execution['smallest_clearance_m']:.0f} mm to a wall"
        )
    return "\n".join(lines)


def _soft(entries: list[dict[str, Any]], what: str) -> list[str]:
    """Return a gait's speeds on soft bodies as one line, none for a robot that has a stiffness."""
    if not entries:
        return []
    speeds = ", ".join("none" if e["speed_m_s"] is None else f"{e['speed_m_s']:.3f}" for e in entries)
    stiffnesses = ", ".join(f"{e['ei_n_m2']:g}" for e in entries)
    return [f"- {what}: {speeds} m/s at {stiffnesses} N m^2"]


def _next(out: Path) -> str:
    """Return what to open and the exact line to type next."""
    page = out / "plan" / "view.html"
    lines = [f"To replay the drive, open {page} in a browser."] if page.exists() else []
    activate = "" if os.environ.get("VIRTUAL_ENV") or not Path(ACTIVATE).exists() else f". {ACTIVATE} && "
    return "\n".join([*lines, "Next, type:", f"  {activate}plan {NEXT_MAZE} --execute"])


def main(argv: list[str] | None = None) -> int:
    """Run the command."""
    parser = make_parser(
        "python -m planners.tour",
        "Do the main job once: optimize a gait, map, calibrate the drive, plan a maze, drive it.",
        "python -m planners.tour --out out",
        robot=False,
    )
    return run_command(parser, run, argv)


if __name__ == "__main__":
    sys.exit(main())

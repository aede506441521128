"""Gaits and drives before another physics engine (DART: rolling wheels, exact Coulomb contact).

    python -m benchmarks.judge --table 192 --sets 50 --mazes 20 --jobs 2

All gaits of the shipped table (or so many of them, drawn by --seed), random ones, and contest mazes driven
closed-loop with the engine as the robot. One gait in eight is refined: half the step, twice the hinges.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np

from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser
from srs_opt.gait import Gait, Wave
from srs_opt.gait_opt.catalogue import default_table
from srs_opt.gait_opt.table import GaitTable
from srs_opt.judge.opinion import Case, opinion_on, ours_of
from srs_opt.robot import Robot, wpi_srs

NAME = "judge"
REFINED = 8  # one gait in so many is played finely too
FREQUENCY_HZ, PRESSURE_KPA = (1.0, 2.0), (20.0, 55.0)
LAG_RAD, LAG_SPREAD_RAD, OFFSET = (0.5, 2.0), 0.4, 0.7


def random_gait(seed: int) -> Gait:
    """Return a wave with a delay and an offset of its own in every segment, either way along the body."""
    rng = np.random.default_rng([seed, 20])
    lag = rng.uniform(*LAG_RAD)
    phases = np.cumsum(lag + LAG_SPREAD_RAD * rng.uniform(-1, 1, 4))
    offsets = np.clip(rng.uniform(-OFFSET, OFFSET) + 0.2 * rng.uniform(-1, 1, 4), -0.9, 0.9)
    wave = Wave(rng.uniform(*FREQUENCY_HZ), rng.uniform(*PRESSURE_KPA), tuple(phases), tuple(offsets))
    gait = wave.gait()
    return gait.reversed_wave() if rng.random() < 0.2 else gait


def judged(kind: str, number: int) -> dict[str, Any]:
    """Judge one gait of the table or one random gait; return its row."""
    robot, refine = wpi_srs(), number % REFINED == 0
    if kind == "table":
        entry = shipped().gaits[number]
        case = Case(entry.name, entry.gait, refine)
    else:
        case = Case(f"random {number}", random_gait(number), refine)
    begun = time.process_time()
    opinion = opinion_on(robot, case.name, case.gait, refine=refine)
    row = {"kind": kind, "number": number, **opinion.to_record()}
    if not opinion.agrees:
        row["ours_on_tyres"] = dict(vars(ours_of(on_tyres(robot), case.gait, None)))
    return row | {"cpu_s": _since(begun)}


def shipped() -> GaitTable:
    """Return the whole shipped table: the planners' gaits and those of drivers alone."""
    return default_table(wpi_srs(), "complex", driver=True)


def on_tyres(robot: Robot) -> Robot:
    """Return the robot with the grip across its wheels that rolling leaves of an isotropic tyre's cone."""
    across = math.sqrt(robot.friction_normal**2 - robot.friction_tangential**2)
    return robot.with_values(friction_normal=across)


def driven(kind: str, number: int) -> dict[str, Any]:
    """Drive one contest maze closed-loop with the engine as the robot; return its row."""
    from benchmarks.pilot import contest
    from planners.drive.engine_plant import drive_in_engine

    begun = time.process_time()
    arena = contest(number, 0.36)
    planned = time.process_time()
    e = drive_in_engine(arena.problem, arena.plan)
    return {
        "kind": kind,
        "number": number,
        "reached": e.execution.reached,
        "contacts": e.contacts,
        "smallest_clearance_m": e.execution.smallest_clearance_m,
        "reason": e.execution.reason,
        "replans": e.execution.replans,
        "plan_s": arena.plan.duration_s,
        "drive_s": e.execution.duration_s,
        "cpu_s": _since(planned),
        "planning_cpu_s": round(planned - begun, 2),
    }


def row(kind: str, number: int) -> dict[str, Any]:
    """Return the row of one item."""
    return driven(kind, number) if kind == "maze" else judged(kind, number)


def _since(begun: float) -> float:
    return round(time.process_time() - begun, 2)


def section(rows: list[dict[str, Any]], when: str) -> Section:
    """Return a line per kind of gait, and one for the drives."""
    columns = [
        "what", "agree", "speed off by: median, most (%)", "turn rate off by: median, most (%)",
        "the engine's own error: median, most (%)", "processor time (s): median, sum",
    ]  # fmt: skip
    lines = []
    for kind, name in (("table", "gaits of the shipped table"), ("random", "random gaits")):
        own = [r for r in rows if r["kind"] == kind]
        if not own:
            continue
        known = [r for r in own if r["ours"]["speed_m_s"] is not None]
        speed = [100 * abs(r["difference"]["speed_m_s"] / r["ours"]["speed_m_s"]) for r in known]
        turning = [r for r in known if abs(r["ours"]["turn_rate_rad_s"]) > 0.1]
        turn = [100 * abs(r["difference"]["turn_rate_rad_s"] / r["ours"]["turn_rate_rad_s"]) for r in turning]
        errors = [
            100 * abs(r["judge"]["error"]["speed_m_s"] / r["judge"]["speed_m_s"])
            for r in own
            if r["judge"]["error"]
        ]
        agree = sum(r["agrees"] for r in own)
        lines.append([name, f"{agree} of {len(own)}", _two(speed), _two(turn), _two(errors), _cpu(own)])
    drives = [r for r in rows if r["kind"] == "maze"]
    if drives:
        clear = sum(r["reached"] and not r["contacts"] for r in drives)
        least = 1e3 * min(r["smallest_clearance_m"] for r in drives)
        name = f"contest mazes driven, without contact (least clearance {least:.1f} mm)"
        lines.append([name, f"{clear} of {len(drives)}", "", "", "", _cpu(drives)])
    hours = sum(r["cpu_s"] for r in rows) / 3600
    notes = [
        "Ours with friction smoothed over 0.3 mm/s. Agreement: 2 % or 2 mm/s in speed, 3 % or 0.02 rad/s in "
        f"turn rate; shares of turn rates above 0.1 rad/s. {hours:.2f} processor hours. {when}",
        *(_disagreement(r) for r in rows if not r.get("agrees", True)),
    ]
    return Section("Judge: gaits and drives in another physics engine", columns, lines, notes)


def _disagreement(r: dict[str, Any]) -> str:
    ours, them, tyres = r["ours"], r["judge"], r["ours_on_tyres"]
    return (
        f"Disagrees: {r['name']}: ours {ours['speed_m_s']:.4f} m/s, {ours['turn_rate_rad_s']:+.4f} rad/s; "
        f"the engine {them['speed_m_s']:.4f}, {them['turn_rate_rad_s']:+.4f}"
        + ("" if them["settled"] else f" (still settling after {them['cycles']} cycles)")
        + f"; ours with the grip across that rolling leaves of a tyre's friction cone (0.3 % less) "
        f"{tyres['speed_m_s']:.4f}, {tyres['turn_rate_rad_s']:+.4f}."
    )


def _two(values: list[float]) -> str:
    return f"{np.median(values):.2f}, {max(values):.2f}" if values else "none"


def _cpu(rows: list[dict[str, Any]]) -> str:
    spent = [r["cpu_s"] for r in rows]
    return f"{np.median(spent):.1f}, {sum(spent):.0f}"


def run(quick: bool) -> Section:
    """Return the stored study; one gait if quick or where there is none."""
    stored = None if quick else stored_rows(NAME)
    if stored is None:
        return section([row("table", 1)], "One gait only.")
    when, rows = stored
    return section(rows, f"Measured {when}.")


def main() -> None:
    """Run the study and print the table."""
    parser = study_parser(NAME, __doc__, sets=50)
    parser.add_argument("--table", type=int, default=math.inf, metavar="N", help="gaits of the table (all)")
    parser.add_argument("--mazes", type=int, default=20, metavar="N")
    options = parser.parse_args()
    count = len(shipped().gaits)
    drawn = np.random.default_rng(options.seed).permutation(count)[: min(options.table, count)]
    items = [("table", int(k)) for k in sorted(drawn)]
    items += [("random", k) for k in range(options.sets)]
    items += [("maze", k) for k in range(options.mazes)]
    print(section(gather(NAME, row, items, options), "").markdown())


if __name__ == "__main__":
    main()

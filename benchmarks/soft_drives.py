"""A maze driven by soft bodies: planned for each of them, and planned for the rigid robot.

    python -m benchmarks.soft_drives --jobs 2

Plans through mazes/first.yaml, driven closed-loop on the compliant model. Every drive must arrive or stop and
say so; none may touch a wall.
"""

from __future__ import annotations

from typing import Any

from benchmarks.planner_true_robots import drive_row
from benchmarks.section import Section
from benchmarks.stored import gather, stored_rows, study_parser
from planners.drive.execute import execute
from planners.plan.inputs import gaits_for, placed_maze, planning_problem
from planners.plan.options import MARGIN_M
from planners.plan.solve import solve_with_lattice
from srs_opt.robot import Robot, wpi_srs

NAME = "soft_drives"
MAZE = "mazes/first.yaml"
STIFFNESSES = (0.02, 0.01, 0.005, 0.003, 0.002)
LIMIT_S = 600.0  # guard for busy machines
PLANS = ("rigid", "own")
Row = dict[str, Any]


def soft(stiffness: float) -> Robot:
    """Return the built-in robot with a bending stiffness."""
    return wpi_srs().with_values(bending_stiffness_n_m2=stiffness)


def attempt(planned_for: str, stiffness: float) -> Row:
    """Plan for the rigid robot or the soft one, drive the soft one."""
    true = soft(stiffness)
    robot = true if planned_for == "own" else wpi_srs()
    problem = planning_problem(robot, placed_maze(robot, MAZE, MARGIN_M), gaits_for(robot))
    plan = solve_with_lattice(problem, time_limit_s=LIMIT_S).plan
    row: Row = {"plan": planned_for, "ei_n_m2": stiffness, "planned": plan is not None}
    if plan is None:
        return row
    return row | drive_row(plan, execute(problem, plan, true))


def section(rows: list[Row], when: str) -> Section:
    """Return a line per plan and stiffness."""
    columns = ["EI (N m²)", "planned for", "plan (s)", "drive (s)", "ended", "clearance (mm)", "replans"]
    lines = [_line(row) for row in rows]
    touched = sum(row.get("collisions", 0) for row in rows)
    arrived = sum(row.get("reached", False) for row in rows)
    note = (
        f"{MAZE}, margin 5 mm, driven closed-loop on the compliant model: {arrived} of {len(rows)} arrive, "
        f"{touched} touch a wall. {when}"
    )
    return Section("Planner: soft bodies through a maze", columns, lines, [note])


def _line(row: Row) -> list[str]:
    planned_for = "this body" if row["plan"] == "own" else "the rigid robot"
    if not row["planned"]:
        return [f"{row['ei_n_m2']:g}", planned_for, "none", "", "", "", ""]
    return [
        f"{row['ei_n_m2']:g}",
        planned_for,
        f"{row['plan_s']:.1f}",
        f"{row['drive_s']:.1f}",
        row["reason"],
        f"{1e3 * row['clearance_m']:.1f}",
        str(row["replans"]),
    ]


def run(quick: bool) -> Section:
    """Return the stored study; one drive where there is none."""
    stored = stored_rows(NAME)
    if stored is None:
        return section([attempt("rigid", 0.005)], "One drive only.")
    when, rows = stored
    return section(rows, f"Measured {when}.")


def main() -> None:
    """Run the study and print the table."""
    options = study_parser(NAME, __doc__, sets=len(STIFFNESSES)).parse_args()
    items = [(plan, ei) for plan in PLANS for ei in STIFFNESSES[: options.sets]]
    print(section(gather(NAME, attempt, items, options), "").markdown())


if __name__ == "__main__":
    main()

"""Gaits of soft bodies: published, rigid optimum, optimum for each stiffness, and one robust gait for all.

``python -m benchmarks.soft_gaits`` optimizes anew (minutes) and keeps the rows; ``run`` shows them.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.section import PICTURES, Section
from benchmarks.stored import gather, stored_rows, study_parser
from srs_opt.errors import NoAnswerError
from srs_opt.figures import COLOURS, new_figure, save_figure, styled
from srs_opt.gait import Gait, published_wave
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.search import search
from srs_opt.gait_opt.softness import robust_gait
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import Robot, wpi_srs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STIFFNESSES = (None, 0.05, 0.02, 0.01, 0.005, 0.003, 0.002, 0.0015)
# best known by CMA-ES of an independent program, from rest, 1-2 Hz, 41-55 kPa
KNOWN = {None: 0.560, 0.02: 0.566, 0.01: 0.557, 0.005: 0.519, 0.003: 0.497, 0.002: 0.518}
REACHED = 0.97  # of that, the goal at 0.02, 0.01, 0.005, 0.003
ROBUST_OVER = (0.002, 0.005, 0.02)
ROBUST_GOAL = 1.9  # times the published gait's speed, the worst of these
CHANGES = {
    "friction": ("friction_tangential", "friction_normal"),
    "curvature per pressure": ("curvature_per_pressure_1_m_kpa",),
    "time constants": ("tau1_s", "tau2_s"),
}
FACTORS = (0.8, 0.9, 1.1, 1.2)


def body(stiffness: float | None) -> Robot:
    """Return the built-in robot with a stiffness, friction smoothed as for the known values."""
    return wpi_srs().with_values(friction_speed_m_s=0.001, bending_stiffness_n_m2=stiffness)


def optimized(stiffness: float | None) -> dict[str, Any]:
    """Return the optimum for one stiffness, from the published gait as the only start."""
    robot = body(stiffness)
    problem = CycleProblem((robot,), robot.own_model, Goal("speed"), Limits())
    found = search(problem, 1)
    return {
        "ei_n_m2": stiffness,
        "gait": found.gait.record(),
        "speed_m_s": found.certificate.speed_m_s,
        "passed": found.certificate.passed,
        "from_rest": None if found.from_rest is None else found.from_rest.record(),
        "seconds": found.seconds,
    }


def speed(robot: Robot, gait: Gait) -> float | None:
    """Return the steady speed from rest, None where there is none."""
    try:
        return steady_gait(robot, gait).speed_m_s
    except NoAnswerError:
        return None


def run(quick: bool) -> Section:
    """Show the stored optima beside the other gaits, simulated now."""
    known = stored_rows("soft_gaits")
    assert known is not None
    measured, rows_kept = known
    stored = [row for row in rows_kept if "ei_n_m2" in row]
    best = {row["ei_n_m2"]: row for row in stored}
    rigid = Gait.of_record(best[None]["gait"])
    curves: dict[str, list[float | None]] = {n: [] for n in ("published", "rigid", "own", "robust")}
    rows, ratios = [], {}
    for ei in STIFFNESSES[:5] if quick else STIFFNESSES:
        robot = body(ei)
        published = published_wave(robot, 2.0, 55.0).gait()
        own = Gait.of_record(best[ei]["gait"]) if ei in best else None
        gaits = (published, rigid, own, robust_gait())
        speeds = [None if gait is None else speed(robot, gait) for gait in gaits]
        for curve, value in zip(curves.values(), speeds):
            curve.append(value)
        shown = ["–" if v is None else f"{v:.3f}" for v in speeds]
        share = ""
        if ei in KNOWN and speeds[2] is not None:
            share = f"{speeds[2] / KNOWN[ei]:.3f}"
            ratios[f"known best over ours at {ei or 'rigid'}"] = KNOWN[ei] / speeds[2]
        rows.append(["∞" if ei is None else f"{ei:g}", *shown[:3], f"{KNOWN.get(ei, '')}", share, shown[3],
                     _over(speeds[3], speeds[0])])  # fmt: skip
    columns = ["EI (N m²)", "published (m/s)", "rigid optimum", "optimum for this EI", "known best",
               "ours over known", "robust gait", "robust over published"]  # fmt: skip
    over = ", ".join(f"{ei:g}" for ei in ROBUST_OVER)
    notes = [
        "From rest, friction smoothed at 1 mm/s, relaxation 5 ms, 1-2 Hz, 41-55 kPa; optima from the "
        f"published gait as the only start. Goals: {REACHED:g} of the known best at 0.02 to 0.003 N m²; the "
        f"robust gait at least {ROBUST_GOAL:g} times the published one at {over} N m². Optimized {measured}.",
        _searched(stored),
    ]
    if quick:
        return Section("Gaits of soft bodies", columns, rows, notes, ratios)
    notes += [_searched_robust(row) for row in rows_kept if "robust_over" in row]
    changed = "; ".join(_changed())
    notes.append(f"Robust gait, other parameters, m/s (times the published gait) at {over} N m²: {changed}.")
    pictures = [_speeds_picture(curves)]
    return Section("Gaits of soft bodies", columns, rows, notes, ratios, pictures)


def _over(value: float | None, base: float | None) -> str:
    return "–" if value is None or not base else f"{value / base:.2f}"


def _searched(stored: list[dict[str, Any]]) -> str:
    told = []
    for row in stored:
        name = "∞" if row["ei_n_m2"] is None else f"{row['ei_n_m2']:g}"
        how = (
            ""
            if row["from_rest"] is None
            else f", {row['from_rest']['evaluations']} gaits from rest (CMA-ES)"
        )
        told.append(f"{name}: {row['seconds']:.0f} s, {'passed' if row['passed'] else 'FAILED'}{how}")
    return "Searches (wall time, certificate): " + "; ".join(told) + "."


def _searched_robust(row: dict[str, Any]) -> str:
    """Return what a search for one robust gait came to, and what that gait makes at other stiffnesses."""
    gait = Gait.of_record(row["gait"])
    found = ", ".join(
        f"{own:.3f} ({own / published:.2f} times the published gait)"
        for own, published in zip(row["speeds_m_s"], row["published_m_s"])
    )
    between = ", ".join(f"{speed(body(ei), gait):.3f} at {ei:g}" for ei in (0.003, 0.01))
    over = " ".join(f"{ei:g}" for ei in row["robust_over"])
    return (
        f"A run of gait_opt --stiffness {over} --starts 1: {found} m/s, certificate "
        f"{'passed' if row['passed'] else 'FAILED'}, {row['from_rest']['evaluations']} gaits from rest; "
        f"{between} N m²."
    )


def _changed() -> list[str]:
    """Return the robust gait's speeds with one group of parameters changed, in words."""
    told = []
    for name, fields in CHANGES.items():
        for factor in FACTORS:
            parts = []
            for ei in ROBUST_OVER:
                robot = body(ei)
                robot = robot.with_values(**{f: factor * getattr(robot, f) for f in fields})
                published = speed(robot, published_wave(robot, 2.0, 55.0).gait())
                own = speed(robot, robust_gait())
                parts.append("–" if own is None else f"{own:.3f} ({_over(own, published)})")
            told.append(f"{name} × {factor:g}: {', '.join(parts)}")
    return told


def _speeds_picture(curves: dict[str, list[float | None]]) -> Path:
    png, _ = save_figure(_speeds_figure(curves), PICTURES / "soft_gaits")
    return png


@styled
def _speeds_figure(curves: dict[str, list[float | None]]) -> Figure:
    from matplotlib.ticker import FixedLocator, NullLocator

    figure, axes = new_figure(height_in=2.9)
    labels = {
        "published": "published gait", "rigid": "optimum of the rigid robot",
        "own": "optimum for this stiffness", "robust": "one robust gait",
    }  # fmt: skip
    flexibility = [0.0 if ei is None else 1 / ei for ei in STIFFNESSES]
    for marker, colour, (name, values) in zip("osd^", COLOURS, curves.items()):
        heights = [float("nan") if v is None else v for v in values]
        axes.plot(flexibility, heights, marker=marker, markersize=3, color=colour, label=labels[name])
    axes.axvspan(1 / ROBUST_OVER[-1], 1 / ROBUST_OVER[0], color=COLOURS[7], alpha=0.15, lw=0)
    shown = [None, 0.02, 0.01, 0.005, 0.003, 0.002, 0.0015]
    axes.xaxis.set(major_locator=FixedLocator([0 if e is None else 1 / e for e in shown]),
                   minor_locator=NullLocator())  # fmt: skip
    axes.set_xticklabels(["∞" if e is None else f"{e:g}" for e in shown], rotation=60)
    axes.set(
        xlabel="bending stiffness EI (N m²), spaced by 1/EI", ylabel="speed from rest (m/s)", ylim=(0, 0.6)
    )
    figure.legend(loc="outside upper left", ncols=2)
    return figure


def main(argv: list[str] | None = None) -> int:
    """Optimize for every stiffness and keep the rows."""
    options = study_parser("soft_gaits", __doc__, len(STIFFNESSES)).parse_args(argv)
    gather("soft_gaits", optimized, [(ei,) for ei in STIFFNESSES[: options.sets]], options)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Everything that can be read off a data set before any model is fitted, as one record and its pictures."""

from __future__ import annotations

import csv
import dataclasses
import math
from pathlib import Path
from typing import IO, Any

from srs_opt.errors import NoAnswerError, SrsError
from srs_opt.files import write_json, write_with
from srs_opt.measurement.actuator_bench import combine_steps
from srs_opt.measurement.bench_files import MAP_COLUMNS
from srs_opt.measurement.bending import BendingFit, bench_robot, fit_bending
from srs_opt.measurement.checks import compare_checks
from srs_opt.measurement.fit_settings import BENDING
from srs_opt.measurement.motion import Motion, motion_map, trial_motion
from srs_opt.measurement.records import DataSet
from srs_opt.measurement.spring_car import breakaway_friction
from srs_opt.measurement.steps import fit_steps
from srs_opt.measurement.tow import analyse_tow
from srs_opt.robot import save_robot


def analyse(dataset: DataSet) -> dict[str, Any]:
    """Return motion per trial, map, friction, actuator, tow and checks; what a set does not hold is left out.

    A trial whose motion cannot be measured is listed under ``skipped`` with the reason.
    """
    motions: list[Motion] = []
    skipped = {}
    for trial in dataset.trials:
        try:
            motions.append(trial_motion(trial, dataset.marker_sd_m, dataset.robot.length_m))
        except SrsError as error:
            skipped[trial.name] = str(error)
    bench, robot = dataset.bench, dataset.robot
    record: dict[str, Any] = {
        "name": dataset.name,
        "motion": [dataclasses.asdict(m) for m in motions],
        "skipped": skipped,
        "map": [dataclasses.asdict(row) for row in motion_map(dataset, tuple(motions))],
    }
    if bench.spring_car:
        friction = breakaway_friction(bench.spring_car, robot.gravity_m_s2)
        record["breakaway_friction"] = {k: dataclasses.asdict(v) for k, v in friction.items()}
    if bench.steps:
        record["actuator"] = dataclasses.asdict(combine_steps(fit_steps(bench.steps)))
        try:
            bending = fit_bending(bench.steps, robot)
        except NoAnswerError as error:
            skipped["bending"] = str(error)
        else:
            record |= {"bending": dataclasses.asdict(bending)} if bending else {}
    if bench.tow:
        record["tow"] = dataclasses.asdict(analyse_tow(bench.tow, robot))
    if bench.checks:
        record["checks"] = [dataclasses.asdict(c) for c in compare_checks(bench.checks, robot)]
    return record


def write_analysis(dataset: DataSet, record: dict[str, Any], folder: Path) -> tuple[Path, ...]:
    """Write analysis.json, map.csv, pictures and, from step tests, robot.yaml; return the files."""
    files = [write_json(folder / "analysis.json", record)]
    if record["map"]:
        files.append(write_with(folder / "map.csv", lambda stream: _write_map(stream, record["map"])))
    if "bending" in record:
        actuator, bending = combine_steps(fit_steps(dataset.bench.steps)), BendingFit(**record["bending"])
        files.append(save_robot(bench_robot(dataset.robot, actuator, bending), folder / "robot.yaml"))
    return (*files, *_pictures(dataset, record, folder))


def _write_map(stream: IO[str], rows: list[dict[str, Any]]) -> None:
    writer = csv.DictWriter(stream, MAP_COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows({k: "" if v is None else v for k, v in row.items()} for row in rows)


def _pictures(dataset: DataSet, record: dict[str, Any], folder: Path) -> list[Path]:
    """Draw the sharpest turn with its circle (Fig. 10) and the step responses (Fig. 6)."""
    import numpy as np

    from srs_opt.figures import save_figure
    from srs_opt.measurement.circle import fit_circle
    from srs_opt.measurement.figures import circle_figure, step_figure, track_figure
    from srs_opt.measurement.shape import shape_from_markers

    files: list[Path] = []
    turning = [m for m in record["motion"] if m["radius_m"] is not None]
    if turning:
        sharpest = min(turning, key=lambda m: abs(m["radius_m"]["value"]))
        trial = dataset.trial(sharpest["trial"])
        centre = trial.centre_m
        if trial.markers_m is not None:
            centre = shape_from_markers(
                dataset.robot, trial.markers_m, dataset.marker_sd_m, spots=trial.spots
            ).centre_m
        assert centre is not None
        steady = np.asarray(centre)[trial.time_s >= sharpest["from_s"]]
        figure = circle_figure(steady, fit_circle(steady))
        files += save_figure(figure, folder / f"circle_{trial.name}")
        files += save_figure(track_figure(trial), folder / f"track_{trial.name}")
    steps = dataset.bench.steps
    if steps:
        files += save_figure(step_figure(steps, fit_steps(steps)), folder / "steps")
    return files


def describe(record: dict[str, Any]) -> str:
    """Return the analysis in words, one line per trial."""
    lines = []
    for motion in record["motion"]:
        speed, rate, radius = motion["speed_m_s"], motion["turn_rate_rad_s"], motion["radius_m"]
        turn = "straight" if radius is None else f"radius {radius['value']:+.4f} m"
        note = "" if motion["settled"] else " (never settles)"
        lines.append(f"  {motion['trial']}: {_with(speed)} m/s, {_with(rate)} rad/s, {turn}{note}")
    lines += [f"  {name}: left out: {reason}" for name, reason in record["skipped"].items()]
    for direction, friction in record.get("breakaway_friction", {}).items():
        lines.append(f"  breakaway friction, {direction}: {friction['mean']:.4f}")
    for curvature in record.get("actuator", {}).get("curvature", ()):
        slope = curvature["slope_1_m_kpa"]
        lines.append(
            f"  C0 over pressure, {curvature['condition']}: {slope['value']:.4f} ± {slope['sd']:.4f} 1/m/kPa"
        )
        if curvature["curve"]:
            points = ", ".join(
                f"{v['c0_1_m']:.3g} ± {v['sd_1_m']:.2g} at {v['pressure_kpa']:g} kPa"
                for v in curvature["curve"]
            )
            lines.append(f"    not proportional (p = {curvature['lack_of_fit_p']:.1g}); C0, 1/m: {points}")
    if "bending" in record:
        lines.append(f"  {_bending_words(BendingFit(**record['bending']))}")
    return "\n".join(lines)


def _bending_words(bending: BendingFit) -> str:
    if bending.scaled is not None:
        bend, slower = bending.scaled
        words = (
            f"no bending stiffness: on the ground segments bend {bend:.3f} times as far and take "
            f"{slower:.3f} times as long, at every pressure alike, which no bending moment does"
        )
        return f"{words} ({bending.pairs} steps on the ground against their lifted twins)"
    if bending.stiffness_n_m2 is None or bending.relative_sd is None:
        words = f"bending stiffness above {bending.stiffer_than_n_m2:.2g} N m^2: as good as rigid"
    else:
        words = f"bending stiffness {bending.stiffness_n_m2:.4g} N m^2 ± {100 * bending.relative_sd:.1f} %"
    words += f" ({bending.pairs} steps on the ground against their lifted twins)"
    if bending.misfit > BENDING.doubtful_misfit:
        words += f"; these differ by more than friction explains (misfit {bending.misfit:.1f})"
    return words


def _with(interval: dict[str, float | None]) -> str:
    value, sd = interval["value"], interval["sd"]
    digits = 4 if not sd else max(2, min(6, 1 - math.floor(math.log10(sd))))
    return f"{value:.{digits}f}" + ("" if sd is None else f" ± {sd:.{digits}f}")

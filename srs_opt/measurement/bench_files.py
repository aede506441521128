"""Reads maps.csv and the bench folder, with checks of what each value implies."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from srs_opt.measurement.plausible import bend_rad
from srs_opt.measurement.records import (
    CONDITIONS,
    DIRECTIONS,
    Bench,
    Check,
    MapRow,
    SpringCarTest,
    StepTest,
    TowTest,
)
from srs_opt.measurement.take_settings import TRACK_CHECK
from srs_opt.problem import Report
from srs_opt.robot import Robot
from srs_opt.table import Row, read_rows

MAP_COLUMNS = (
    "frequency_hz",
    "pressure_kpa",
    "offset",
    "phase_lag_rad",
    "speed_m_s",
    "speed_sd_m_s",
    "radius_m",
    "radius_sd_m",
    "replicates",
)
STEP_COLUMNS = ("test", "segment", "condition", "pressure_kpa", "time_s", "curvature_1_m")
SPRING_CAR_COLUMNS = ("direction", "spring_n_m", "car_mass_kg", "deflection_m")
TOW_COLUMNS = ("speed_m_s", "force_n", "with_tether")
CHECK_COLUMNS = ("quantity", "value", "sd")


def read_maps(robot: Robot, report: Report) -> tuple[MapRow, ...]:
    """Read maps.csv, and check that its values can be this robot's."""
    rows = read_map_rows("maps.csv", report)
    _check_maps(rows, robot, report)
    return tuple(rows)


def read_map_rows(file: str, report: Report) -> list[MapRow]:
    """Read a table of measured gaits."""
    rows = []
    for row in read_rows(file, MAP_COLUMNS, (), report):
        numbers = {name: row.number(name, report) for name in MAP_COLUMNS[:6]}
        radius = row.number("radius_m", report, math.inf)
        radius_sd = row.number("radius_sd_m", report, math.inf)
        replicates = row.number("replicates", report, 1.0)
        for name in ("speed_sd_m_s", "frequency_hz", "pressure_kpa"):
            if numbers[name] < 0:
                report.error(file, row.line, f"{name}: must not be negative, found {numbers[name]:g}")
        if not (replicates >= 1 and replicates == int(replicates)):
            report.error(file, row.line, "replicates: expected a whole number from 1")
            replicates = 1.0
        if radius == 0 or radius_sd < 0:
            report.error(
                file, row.line, "radius_m may not be 0, nor radius_sd_m negative (empty when straight)"
            )
        straight = not math.isfinite(radius)
        sd = None if straight or not math.isfinite(radius_sd) else radius_sd
        rows.append(
            MapRow(
                **numbers, radius_m=None if straight else radius, radius_sd_m=sd, replicates=int(replicates)
            )
        )
    return rows


def _check_maps(rows: list[MapRow], robot: Robot, report: Report) -> None:
    fastest = TRACK_CHECK.top_speed_body
    checks = (
        ("speed_m_s", [abs(r.speed_m_s) / robot.length_m for r in rows], fastest, 3e-3, "mm/s", "km/s"),
        ("radius_m", [abs(r.radius_m) / robot.length_m for r in rows if r.radius_m], 50.0, 0.02, "mm", "km"),
        ("pressure_kpa", [bend_rad(r.pressure_kpa, robot) for r in rows], 2 * math.pi, 0.01, "Pa", "MPa"),
        ("phase_lag_rad", [abs(r.phase_lag_rad) for r in rows], 2 * math.pi + 1e-3, 0.0, "degrees", ""),
        ("frequency_hz", [r.frequency_hz for r in rows], 100.0, 0.02, "mHz", "kHz"),
    )
    for column, ratios, high, low, unit_high, unit_low in checks:
        finite = [r for r in ratios if math.isfinite(r)]
        if not finite:
            continue
        middle = float(np.median(finite))
        if middle > high:
            report.error("maps.csv", None, f"{column}: far too large for this robot (in {unit_high}?)")
        elif middle < low:
            report.error("maps.csv", None, f"{column}: far too small for this robot (in {unit_low}?)")


def read_bench(folder: Path, robot: Robot, report: Report) -> Bench:
    """Read whichever bench tests there are."""
    bench = folder / "bench"
    if not bench.is_dir():
        return Bench()
    readers: dict[str, Callable[[Robot, Report], tuple[object, ...]]] = {
        "steps": _read_steps,
        "spring_car": _read_spring_car,
        "tow": _read_tow,
        "checks": _read_checks,
    }
    for path in sorted(bench.glob("*.csv")):
        if path.stem not in readers:
            report.warn(f"bench/{path.name}", None, f"is not one of {', '.join(readers)} and is ignored")
    found = {name: read(robot, report) for name, read in readers.items() if (bench / f"{name}.csv").is_file()}
    return Bench(**found)  # type: ignore[arg-type]


def _read_steps(robot: Robot, report: Report) -> tuple[StepTest, ...]:
    file = "bench/steps.csv"
    groups: dict[tuple[str, int | None, str, float], list[tuple[float, float]]] = {}
    first: dict[tuple[str, int | None, str, float], int] = {}
    for row in read_rows(file, STEP_COLUMNS, (), report):
        segment = row.number("segment", report, 0.0)
        if not (segment == int(segment) if math.isfinite(segment) else True) or segment > robot.segments:
            report.error(file, row.line, f"segment: expected 1 to {robot.segments}, found {segment:g}")
            segment = 0.0
        condition = row.word("condition", CONDITIONS, "", report)
        pressure, time, curvature = (row.number(name, report) for name in STEP_COLUMNS[3:])
        number = int(segment) if segment >= 1 else None
        key = (row.text("test"), number, condition, pressure)
        first.setdefault(key, row.line)
        groups.setdefault(key, []).append((time, curvature))
    tests = []
    for key, samples in groups.items():
        values = np.array(samples, dtype=float)
        test = StepTest(*key, time_s=values[:, 0], curvature_1_m=values[:, 1])
        _check_step(test, first[key], robot, report)
        tests.append(test)
    return tuple(tests)


def _check_step(test: StepTest, line: int, robot: Robot, report: Report) -> None:
    file, time = "bench/steps.csv", test.time_s
    if np.isnan(time).any() or np.isnan(test.curvature_1_m).any():
        return
    if len(time) < 4:
        report.error(file, line, f"test '{test.test}' has {len(time)} samples, expected 4 or more")
        return
    steps, settle = np.diff(time), robot.tau1_s + robot.tau2_s
    if (steps <= 0).any():
        report.error(file, line, f"test '{test.test}': time_s must increase from row to row")
        return
    if np.median(steps) > 3 * settle:
        message = f"test '{test.test}': samples lie {np.median(steps):g} s apart, longer than the step takes"
        report.error(file, line, f"{message} (in milliseconds?)")
    elif time[-1] - time[0] < 0.02 * settle:
        report.error(
            file, line, f"test '{test.test}' lasts {time[-1] - time[0]:g} s, far too short (in kiloseconds?)"
        )
    expected = robot.curvature_per_pressure_1_m_kpa * test.pressure_kpa
    if bend_rad(test.pressure_kpa, robot) > 2 * math.pi or test.pressure_kpa <= 0:
        message = f"pressure_kpa: {test.pressure_kpa:g} kPa cannot be meant (in pascals?)"
        report.error(file, line, message)
    elif not 0.02 < float(np.abs(test.curvature_1_m).max()) / max(expected, 1e-9) < 50:
        found = float(np.abs(test.curvature_1_m).max())
        message = f"test '{test.test}': largest curvature {found:.3g} 1/m, expected about {expected:.3g}"
        report.error(file, line, f"{message} (in 1/mm, or pressure in megapascals?)")


def _read_spring_car(robot: Robot, report: Report) -> tuple[SpringCarTest, ...]:
    file, tests = "bench/spring_car.csv", []
    known = {"tangential": robot.friction_tangential, "normal": robot.friction_normal}
    for row in read_rows(file, SPRING_CAR_COLUMNS, (), report):
        direction = row.word("direction", DIRECTIONS, "", report)
        spring, mass, deflection = (row.number(name, report) for name in SPRING_CAR_COLUMNS[1:])
        if direction not in known or not (spring > 0 and mass > 0 and deflection > 0):
            if min(spring, mass, deflection) <= 0:
                report.error(file, row.line, "spring_n_m, car_mass_kg and deflection_m must be above 0")
            continue
        tests.append(SpringCarTest(direction, spring, mass, deflection))
        friction = spring * deflection / (mass * robot.gravity_m_s2)
        ratio = friction / known[direction] if known[direction] > 0 else 1.0
        if not 1 / 50 < ratio < 50:
            hint = "deflection in millimetres" if ratio > 1 else "mass in grams, spring in N/mm"
            message = f"gives a friction coefficient of {friction:.3g} (the robot file: {known[direction]:g})"
            report.error(file, row.line, f"{message}: {hint}?")
    return tuple(tests)


def _read_tow(robot: Robot, report: Report) -> tuple[TowTest, ...]:
    file, tests = "bench/tow.csv", []
    weight = robot.links * robot.link_mass_kg * robot.gravity_m_s2
    for row in read_rows(file, TOW_COLUMNS, (), report):
        speed, force = row.number("speed_m_s", report), row.number("force_n", report)
        with_tether = row.yes("with_tether", True, report)
        if abs(speed) > TRACK_CHECK.top_speed_body * robot.length_m:
            report.error(file, row.line, f"speed_m_s: {speed:g} m/s is too fast (in mm/s?)")
        if abs(force) > 10 * weight:
            message = f"force_n: {force:g} N is over ten times the robot's weight of {weight:.3g} N"
            report.error(file, row.line, f"{message} (in millinewtons?)")
        if math.isfinite(speed) and math.isfinite(force):
            tests.append(TowTest(speed, force, with_tether))
    if tests and max(abs(t.force_n) for t in tests) < 0.02 * weight * robot.friction_tangential:
        report.error(file, None, "force_n: all forces are far below rolling friction (in kilonewtons?)")
    return tuple(tests)


def _read_checks(robot: Robot, report: Report) -> tuple[Check, ...]:
    file, checks = "bench/checks.csv", []
    weight = robot.links * robot.link_mass_kg * robot.gravity_m_s2
    lines: dict[str, int] = {}
    for row in read_rows(file, CHECK_COLUMNS, (), report):
        check = _read_check(row, report)
        if check.quantity in lines:
            report.warn(file, row.line, f"'{check.quantity}' was also read on line {lines[check.quantity]}")
        lines.setdefault(check.quantity, row.line)
        if check.quantity.endswith("delay_s") and abs(check.value) > 5:
            report.error(file, row.line, f"{check.quantity}: {check.value:g} s (in milliseconds?)")
        if check.quantity.endswith("load_n") and abs(check.value) > 100 * weight:
            report.error(file, row.line, f"{check.quantity}: {check.value:g} N (in millinewtons?)")
        checks.append(check)
    return tuple(checks)


def _read_check(row: Row, report: Report) -> Check:
    quantity, value, sd = row.text("quantity"), row.number("value", report), row.number("sd", report)
    if not quantity:
        report.error(row.file, row.line, "quantity: expected a name, found an empty cell")
    if sd < 0:
        report.error(row.file, row.line, f"sd: must not be negative, found {sd:g}")
    return Check(quantity, value, sd)

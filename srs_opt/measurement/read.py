"""Reads the whole layout of a measured data set, collecting every problem on the way."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from srs_opt.document import Document, read_yaml, unknown_word
from srs_opt.errors import InputError
from srs_opt.gait_file import SCHEDULE_COLUMNS
from srs_opt.measurement.applied import FOLDER as APPLIED_FOLDER
from srs_opt.measurement.applied import read_applied
from srs_opt.measurement.bench_files import read_bench, read_maps
from srs_opt.measurement.chain import chain_of
from srs_opt.measurement.plausible import check_robot, check_trial_row
from srs_opt.measurement.records import (
    CENTRE_OF_MASS,
    KINDS,
    MARKER_ORDERS,
    STARTS,
    TAIL_TO_HEAD,
    DataSet,
    Schedule,
    Trial,
)
from srs_opt.measurement.spots import Spots, spots_of
from srs_opt.measurement.tracks import check_track, read_track
from srs_opt.problem import Report
from srs_opt.robot import Robot, robot_from_document, robot_problems, wpi_srs
from srs_opt.table import Row, read_rows, safe_name

TRIAL_COLUMNS = (
    "trial",
    "frequency_hz",
    "pressure_kpa",
    "offset",
    "phase_lag_rad",
    "heading_rad",
    "duration_s",
)
CAMERA_KEYS = ("rate_hz", "marker_sd_m", "correlated_sd_m", "correlation_s")
OPTIONAL_TRIAL_COLUMNS = ("schedule", "tether", "floor", "replicate_of", "kind", "start")


@dataclass(frozen=True)
class Header:
    """What dataset.yaml says."""

    name: str
    robot: Robot
    rate_hz: float
    marker_sd_m: float
    markers: str
    spots: Spots | None = None
    correlated_sd_m: float = 0.0
    correlation_s: float = 0.0


def read_folder(folder: Path, report: Report) -> DataSet | None:
    """Read `folder`; return what could be made of it (None when not even that) and fill `report`."""
    if not folder.is_dir():
        report.error(".", None, "no such folder (expected a measured data set with dataset.yaml)")
        return None
    header = _read_header(folder, report)
    trials: tuple[Trial, ...] = ()
    has_maps = (folder / "maps.csv").is_file()
    if (folder / "trials.csv").exists() or not has_maps:
        trials = _read_trials(folder, header, report)
    maps = read_maps(header.robot, report) if has_maps else ()
    bench = read_bench(folder, header.robot, report)
    return DataSet(
        name=header.name,
        robot=header.robot,
        rate_hz=header.rate_hz,
        marker_sd_m=header.marker_sd_m,
        markers=header.markers,
        trials=trials,
        maps=maps,
        bench=bench,
        folder=folder,
        correlated_sd_m=header.correlated_sd_m,
        correlation_s=header.correlation_s,
    )


def _read_header(folder: Path, report: Report) -> Header:
    file = "dataset.yaml"
    try:
        document = read_yaml(folder / file, "a data set's description (YAML)")
    except InputError as error:
        report.add_input_error(file, error)
        document = Document(str(folder / file), {})
    record = document.value
    if not isinstance(record, dict):
        report.error(file, None, "expected the keys name, robot, camera and markers")
        record = {}
    fields = _Fields(document, record, file, report)
    fields.only(("name", "robot", "camera", "markers"))
    robot = _read_robot(folder, str(record.get("robot", "robot.yaml")), fields, report)
    rate = fields.number(("camera", "rate_hz"), 1e-3, 1e5, "frames per second")
    sd = fields.number(("camera", "marker_sd_m"), 1e-9, robot.pitch_m / 3, "metres (found millimetres?)")
    correlated, correlation = _correlated_noise(fields, robot)
    markers, spots = record.get("markers", TAIL_TO_HEAD), None
    if isinstance(markers, list):
        found, problems = spots_of(document, ("markers",), robot.links)
        for problem in problems:
            report.add_input_error(file, problem)
        markers, spots = TAIL_TO_HEAD, found or None
    elif markers not in MARKER_ORDERS:
        words = f"must be a list of places, or one of {', '.join(MARKER_ORDERS)}"
        fields.error(("markers",), f"{words}, found {str(markers)[:40]!r}")
        markers = TAIL_TO_HEAD
    name = record.get("name", folder.resolve().name)
    return Header(str(name), robot, rate, sd, str(markers), spots, correlated, correlation)


def _correlated_noise(fields: _Fields, robot: Robot) -> tuple[float, float]:
    """Return deviation (m) and correlation time (s) of the camera's coloured noise, 0 and 0 without."""
    places = ("camera", "correlated_sd_m"), ("camera", "correlation_s")
    camera = fields.record.get("camera")
    given = [isinstance(camera, dict) and key in camera for _, key in places]
    if not any(given):
        return 0.0, 0.0
    if not all(given):
        missing = places[given.index(False)]
        fields.error(missing, "missing; correlated noise takes both correlated_sd_m and correlation_s")
        return 0.0, 0.0
    sd = fields.number(places[0], 0.0, robot.pitch_m / 3, "metres (found millimetres?)")
    return sd, fields.number(places[1], 0.0, 1e4, "seconds")


class _Fields:
    """Checks the keys of dataset.yaml one by one, so that all complaints come at once."""

    def __init__(self, document: Document, record: dict[str, Any], file: str, report: Report) -> None:
        self.document, self.record, self.file, self.report = document, record, file, report

    def error(self, place: tuple[str | int, ...], message: str) -> None:
        line = self.document.lines.get(place) or self.document.lines.get(place[:-1])
        self.report.error(self.file, line, f"{'.'.join(map(str, place))}: {message}")

    def only(self, known: tuple[str, ...]) -> None:
        for key in self.record:
            if key not in known:
                self.error((str(key),), unknown_word("key", str(key), list(known)))
        camera = self.record.get("camera")
        for key in camera if isinstance(camera, dict) else ():
            if key not in CAMERA_KEYS:
                self.error(("camera", str(key)), unknown_word("key", str(key), list(CAMERA_KEYS)))

    def number(self, place: tuple[str, str], low: float, high: float, unit: str) -> float:
        table = self.record.get(place[0])
        value = table.get(place[1]) if isinstance(table, dict) else None
        good = isinstance(value, (int, float)) and not isinstance(value, bool)
        if not good or not math.isfinite(float(value or 0)) or not low <= float(value or 0) <= high:
            found = "nothing" if value is None else repr(value)[:40]
            self.error(place, f"expected a number from {low:g} to {high:.3g} {unit}, found {found}")
            return math.nan
        return float(value or 0)


def _read_robot(folder: Path, name: str, fields: _Fields, report: Report) -> Robot:
    reason = safe_name(folder, name)
    if reason:
        fields.error(("robot",), f"'{name[:60]}' {reason}")
        return wpi_srs()
    try:
        document = read_yaml(folder / name, "a robot file (YAML)", lenient=True)
        problems = robot_problems(document)
    except InputError as error:
        problems = [error]
    for problem in problems:
        report.add_input_error(name, problem)
    if problems:
        return wpi_srs()
    robot = robot_from_document(document)
    check_robot(robot, name, report)
    return robot


def _read_trials(folder: Path, header: Header, report: Report) -> tuple[Trial, ...]:
    rows = read_rows("trials.csv", TRIAL_COLUMNS, OPTIONAL_TRIAL_COLUMNS, report)
    names: dict[str, int] = {}
    schedules: dict[str, Schedule | None] = {}
    trials = []
    for row in rows:
        name = row.text("trial")
        if name.casefold() in names:
            line = names[name.casefold()]
            report.error(row.file, row.line, f"trial '{name[:60]}' is already on line {line}")
            continue
        names[name.casefold()] = row.line
        trial = _read_trial(folder, row, header, schedules, report)
        if trial is not None:
            trials.append(trial)
    for row in rows:
        original = row.text("replicate_of")
        if original and original.casefold() not in names:
            report.error(row.file, row.line, f"replicate_of: there is no trial '{original[:60]}'")
    _warn_of_strays(folder, names, report)
    return tuple(trials)


def _read_trial(
    folder: Path, row: Row, header: Header, schedules: dict[str, Schedule | None], report: Report
) -> Trial | None:
    name = row.text("trial")
    reason = safe_name(folder, name) or ("is not a plain name" if "/" in name else None)
    if reason:
        report.error(row.file, row.line, f"trial: '{name[:60]}' {reason}")
        return None
    kind = row.word("kind", KINDS, "gait", report)
    schedule = _read_schedule(folder, row, header.robot, schedules, report)
    idle = 0.0 if kind != "gait" else None
    no_wave = 0.0 if schedule or (folder / APPLIED_FOLDER / f"{name}.csv").is_file() else idle
    frequency = row.number("frequency_hz", report, 1 / schedule.period_s if schedule else idle)
    values = {
        "frequency_hz": frequency,
        "pressure_kpa": row.number("pressure_kpa", report, idle),
        "offset": row.number("offset", report, no_wave),
        "phase_lag_rad": row.number("phase_lag_rad", report, no_wave),
        "heading_rad": row.number("heading_rad", report, 0.0 if kind != "gait" else None),
        "duration_s": row.number("duration_s", report),
    }
    check_trial_row(row, values, kind, header.robot, header.rate_hz, report)
    file = f"trials/{name}.csv"
    if not (folder / file).is_file():
        report.error(row.file, row.line, f"trial '{name}' is listed and {file} is missing")
        return None
    track = read_track(file, header.markers, chain_of(header.robot, header.spots), report)
    if track is None:
        return None
    trial = Trial(
        name=name,
        **values,
        time_s=track.time_s,
        markers_m=track.points_m if header.markers == TAIL_TO_HEAD else None,
        centre_m=track.points_m[:, 0] if header.markers == CENTRE_OF_MASS else None,
        schedule=schedule,
        applied=read_applied(folder, name, header.robot, values["pressure_kpa"], report),
        tether=row.yes("tether", True, report),
        floor=row.text("floor") or None,
        replicate_of=row.text("replicate_of") or None,
        kind=kind,
        spots=header.spots,
        moving=row.word("start", STARTS, "rest", report) == "moving",
    )
    check_track(trial, track, header.robot, header.rate_hz, header.marker_sd_m, report)
    return trial


def _read_schedule(
    folder: Path, row: Row, robot: Robot, known: dict[str, Schedule | None], report: Report
) -> Schedule | None:
    """Read the schedule that a trial names: ``name``, ``name.csv`` or ``schedules/name.csv``."""
    text = row.text("schedule")
    if not text:
        return None
    name = text.removeprefix("schedules/").removesuffix(".csv")
    if name not in known:
        file = f"schedules/{name}.csv"
        reason = safe_name(folder, file) or (None if (folder / file).is_file() else f"has no file {file}")
        if reason:
            report.error(row.file, row.line, f"schedule: '{text[:60]}' {reason}")
            known[name] = None
        else:
            known[name] = parse_schedule(name, file, robot, report)
    return known[name]


def parse_schedule(name: str, file: str, robot: Robot, report: Report) -> Schedule | None:
    """Read one schedule; None (and a report) when it holds none."""
    rows = read_rows(file, SCHEDULE_COLUMNS, (), report)
    intervals, periods = [], set()
    for row in rows:
        segment, on, off, period = (row.number(column, report) for column in SCHEDULE_COLUMNS)
        if any(math.isnan(v) for v in (segment, on, off, period)):
            continue
        if segment != int(segment) or not 1 <= segment <= robot.segments:
            report.error(file, row.line, f"segment: expected 1 to {robot.segments}, found {segment:g}")
        elif period <= 0:
            report.error(file, row.line, f"period_s: must be above 0, found {period:g}")
        elif not (0 <= on <= period and 0 <= off <= period):
            hint = " (in milliseconds?)" if max(on, off) > 50 * period else ""
            report.error(file, row.line, f"on_s and off_s must lie between 0 and the period {period:g}{hint}")
        else:
            intervals.append((int(segment), on, off))
            periods.add(period)
    if len(periods) > 1:
        report.error(file, None, f"has several periods ({', '.join(f'{p:g}' for p in sorted(periods))} s)")
    return Schedule(name, min(periods), tuple(intervals)) if periods else None


def _warn_of_strays(folder: Path, names: dict[str, int], report: Report) -> None:
    trials = folder / "trials"
    for path in sorted(trials.glob("*.csv")) if trials.is_dir() else ():
        if path.stem.casefold() not in names:
            report.warn(f"trials/{path.name}", None, "is not listed in trials.csv and is ignored")

"""Load and write measured data sets."""

from __future__ import annotations

import csv
import math
import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import IO

import numpy as np

from srs_opt.errors import InputError
from srs_opt.files import write_text, write_with
from srs_opt.gait_file import SCHEDULE_COLUMNS
from srs_opt.measurement import bench_files, read
from srs_opt.measurement.applied import FOLDER as APPLIED_FOLDER
from srs_opt.measurement.applied import applied_text
from srs_opt.measurement.records import (
    CENTRE_OF_MASS,
    CONDITIONS,
    DIRECTIONS,
    KINDS,
    MARKER_ORDERS,
    TAIL_TO_HEAD,
    Bench,
    Check,
    DataSet,
    MapRow,
    Schedule,
    SpringCarTest,
    StepTest,
    TowTest,
    Trial,
)
from srs_opt.measurement.tracks import track_columns
from srs_opt.problem import Report
from srs_opt.robot import save_robot


def load_dataset(folder: Path | str) -> DataSet:
    """Read a measured data set.

    Parameters
    ----------
    folder : path
        Folder with dataset.yaml.

    Raises
    ------
    InputError
        For the first error found, with the number of the others; see
        `srs_opt.measurement.validate.problems` for all of them.
    """
    folder = Path(folder)
    report = Report(folder)
    dataset = read.read_folder(folder, report)
    errors = [p for p in report.ordered() if p.severity == "error"]
    if errors:
        first = errors[0]
        place = f"{first.file}:{first.line}" if first.line else first.file
        more = (
            f" (and {len(errors) - 1} more: python -m srs_opt.measurement {shlex.quote(str(folder))})"
            if len(errors) > 1
            else ""
        )
        raise InputError(f"{folder / place}: {first.message}{more}")
    if dataset is None:  # without errors there is always a set
        raise InputError(f"{folder}: not a data set")
    return dataset


def write_dataset(dataset: DataSet, folder: Path | str) -> Path:
    """Write `dataset` in the layout that `load_dataset` reads; each file whole or not at all.

    dataset.yaml comes last, so that an interrupted write does not look like a data set.
    """
    folder = Path(folder)
    save_robot(dataset.robot, folder / "robot.yaml")
    for trial in dataset.trials:
        _write_track(trial, folder / "trials" / f"{trial.name}.csv")
        if trial.applied is not None:
            write_text(folder / APPLIED_FOLDER / f"{trial.name}.csv", applied_text(trial.applied))
    for schedule in {t.schedule.name: t.schedule for t in dataset.trials if t.schedule}.values():
        rows = ((s, _text(on), _text(off), _text(schedule.period_s)) for s, on, off in schedule.intervals)
        _write_table(folder / "schedules" / f"{schedule.name}.csv", SCHEDULE_COLUMNS, rows)
    if dataset.trials:
        _write_trials(dataset.trials, folder / "trials.csv")
    if dataset.maps:
        maps = ([_text(getattr(row, name)) for name in bench_files.MAP_COLUMNS] for row in dataset.maps)
        _write_table(folder / "maps.csv", bench_files.MAP_COLUMNS, maps)
    _write_bench(dataset.bench, folder / "bench")
    write_text(folder / "dataset.yaml", _header(dataset))
    return folder


def _header(dataset: DataSet) -> str:
    import yaml

    camera = {"rate_hz": float(dataset.rate_hz), "marker_sd_m": float(dataset.marker_sd_m)}
    if dataset.correlated_sd_m:
        camera |= {k: float(getattr(dataset, k)) for k in ("correlated_sd_m", "correlation_s")}
    spots = next((t.spots for t in dataset.trials if t.spots is not None), None)
    markers = dataset.markers if spots is None else [spot.record() for spot in spots]
    record = {"name": dataset.name, "robot": "robot.yaml", "camera": camera, "markers": markers}
    return yaml.safe_dump(record, sort_keys=False)


def _write_track(trial: Trial, path: Path) -> None:
    points = trial.markers_m if trial.markers_m is not None else trial.centre_m
    if points is None:
        raise InputError(f"trial '{trial.name}' has no track to write")
    flat = points.reshape(len(trial.time_s), -1)
    table = np.column_stack([trial.time_s, flat])
    columns = track_columns(TAIL_TO_HEAD if points.ndim == 3 else CENTRE_OF_MASS, flat.shape[1] // 2)
    # micrometres and microseconds: far below any camera's noise
    template = ",".join(["%.6f"] * table.shape[1])
    lines = [(template % tuple(row)).replace("nan", "") for row in table]
    write_text(path, "\n".join([",".join(columns), *lines]) + "\n")


def _write_trials(trials: Sequence[Trial], path: Path) -> None:
    optional = {
        "schedule": [t.schedule.name if t.schedule else "" for t in trials],
        "tether": ["yes" if t.tether else "no" for t in trials],
        "floor": [t.floor or "" for t in trials],
        "replicate_of": [t.replicate_of or "" for t in trials],
        "kind": [t.kind for t in trials],
        "start": ["moving" if t.moving else "rest" for t in trials],
    }
    usual = {
        "schedule": {""},
        "tether": {"yes"},
        "floor": {""},
        "replicate_of": {""},
        "kind": {"gait"},
        "start": {"rest"},
    }
    used = {name: cells for name, cells in optional.items() if set(cells) != usual[name]}
    rows = (
        [
            t.name,
            *(_text(getattr(t, c)) for c in read.TRIAL_COLUMNS[1:]),
            *(cells[i] for cells in used.values()),
        ]
        for i, t in enumerate(trials)
    )
    _write_table(path, (*read.TRIAL_COLUMNS, *used), rows)


def _write_bench(bench: Bench, folder: Path) -> None:
    if bench.steps:
        write_steps(bench.steps, folder / "steps.csv")
    plain = (
        ("spring_car", bench_files.SPRING_CAR_COLUMNS, bench.spring_car),
        ("tow", bench_files.TOW_COLUMNS, bench.tow),
        ("checks", bench_files.CHECK_COLUMNS, bench.checks),
    )
    for name, columns, records in plain:
        if records:
            rows = ([_text(getattr(record, column)) for column in columns] for record in records)
            _write_table(folder / f"{name}.csv", columns, rows)


def write_steps(steps: Sequence[StepTest], path: Path) -> Path:
    """Write step tests as bench/steps.csv holds them."""
    rows = (
        [
            s.test,
            "" if s.segment is None else s.segment,
            s.condition,
            _text(s.pressure_kpa),
            _text(t),
            _text(k),
        ]
        for s in steps
        for t, k in zip(s.time_s, s.curvature_1_m)
    )
    _write_table(path, bench_files.STEP_COLUMNS, rows)
    return path


def _write_table(path: Path, columns: Sequence[str], rows: Iterable[Iterable[object]]) -> None:
    def fill(stream: IO[str]) -> None:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)

    write_with(path, fill)


def _text(value: object) -> str:
    """Return a cell: nothing for None, yes/no, numbers to nine digits."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.9g}" if isinstance(value, (int, float)) else str(value)


__all__ = [
    "CENTRE_OF_MASS",
    "CONDITIONS",
    "DIRECTIONS",
    "KINDS",
    "MARKER_ORDERS",
    "TAIL_TO_HEAD",
    "Bench",
    "Check",
    "DataSet",
    "MapRow",
    "Schedule",
    "SpringCarTest",
    "StepTest",
    "TowTest",
    "Trial",
    "load_dataset",
    "write_dataset",
    "write_steps",
]

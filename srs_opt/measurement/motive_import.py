"""Motive takes and a list of trials become a measured data set."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.chain import Chain, chain_of
from srs_opt.measurement.find_chain import best_start
from srs_opt.measurement.ground import ground_axes, to_ground, without_ghosts
from srs_opt.measurement.labels import follow, take
from srs_opt.measurement.motive import Take
from srs_opt.measurement.onset import Gait, find_onset, noise_sd
from srs_opt.measurement.records import KINDS, Array, Bench, Check, DataSet, Trial
from srs_opt.problem import Report
from srs_opt.robot import Robot
from srs_opt.table import Row, read_rows

Points = Literal["auto", "markers", "bodies"]
SETTINGS = ("frequency_hz", "pressure_kpa", "offset", "phase_lag_rad")
OPTIONAL = ("take", "heading_rad", "duration_s", "valve_start_s", "tether", "floor", "replicate_of", "kind")


@dataclass(frozen=True)
class ImportOptions:
    """How to read the takes.

    Attributes
    ----------
    head_marker : str or None
        Label of the head's marker; without it the direction of motion tells.
    up : str
        Direction up in Motive's axes (`srs_opt.measurement.ground.ground_axes`).
    points : {"auto", "markers", "bodies"}
        Follow markers, or the pivots of rigid bodies; auto takes bodies when there is one per link.
    valve_start_s : float or None
        Valves' start on the take's clock, for all takes; the trials' own column valve_start_s wins.
    marker_sd_m : float or None
        Noise of a coordinate; estimated from the tracks when not given.
    """

    head_marker: str | None = None
    up: str = "auto"
    points: Points = "auto"
    valve_start_s: float | None = None
    marker_sd_m: float | None = None


@dataclass(frozen=True)
class TrialNote:
    """What was found out about one trial."""

    trial: str
    take: str
    valve_start_s: float
    valve_start_sd_s: float | None
    lost_fraction: float
    ghosts: int
    warnings: tuple[str, ...]


def read_trial_list(path: Path) -> list[Row]:
    """Read the list of trials: trial, frequency_hz, pressure_kpa, offset, phase_lag_rad and optional columns.

    Raises
    ------
    InputError
        For the first problem found, with the number of others.
    """
    report = Report(path.parent)
    rows = read_rows(path.name, ("trial", *SETTINGS), OPTIONAL, report)
    for row in rows:
        for column in SETTINGS:
            row.number(column, report, 0.0 if row.text("kind") not in ("", "gait") else None)
        for column in ("heading_rad", "duration_s", "valve_start_s"):
            row.number(column, report, 0.0)
        row.word("kind", KINDS, "gait", report)
        row.yes("tether", True, report)
    errors = report.errors()
    if errors:
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        raise InputError(f"{path.parent / errors[0].file}:{errors[0].line or 1}: {errors[0].message}{more}")
    return rows


def import_takes(
    takes: Sequence[Take], rows: Sequence[Row], robot: Robot, name: str, options: ImportOptions
) -> tuple[DataSet, tuple[TrialNote, ...]]:
    """Return the data set that takes and trials make, and a note on each trial.

    Raises
    ------
    InputError
        If a trial has no take, or the robot cannot be found in one.
    """
    by_name = {key: t for t in takes for key in (t.name, t.source.name, t.source.stem)}
    rates = {round(t.rate_hz, 6) for t in takes}
    if len(rates) != 1:
        raise InputError(f"the takes have different frame rates ({', '.join(map(str, sorted(rates)))} Hz)")
    trials, notes = [], []
    for row in rows:
        key = row.text("take") or row.text("trial")
        found = by_name.get(key) or (takes[0] if len(takes) == len(rows) == 1 else None)
        if found is None:
            known = ", ".join(sorted({t.source.stem for t in takes}))
            raise InputError(f"{row.file}:{row.line}: no take is called '{key[:60]}' (takes: {known})")
        trial, note = import_trial(found, row, robot, options)
        trials.append(trial)
        notes.append(note)
    sds = [noise_sd(t.markers_m) for t in trials if t.markers_m is not None]
    sd = options.marker_sd_m or max(float(np.median(sds)), 1e-6)
    spreads = [n.valve_start_sd_s for n in notes if n.valve_start_sd_s is not None]
    checks = (Check("clock_alignment_s", 0.0, float(np.median(spreads))),) if spreads else ()
    dataset = DataSet(
        name=name,
        robot=robot,
        rate_hz=takes[0].rate_hz,
        marker_sd_m=float(f"{sd:.3g}"),
        trials=tuple(trials),
        bench=Bench(checks=checks),
    )
    return dataset, tuple(notes)


def import_trial(source: Take, row: Row, robot: Robot, options: ImportOptions) -> tuple[Trial, TrialNote]:
    """Find the robot in one take, order its markers tail to head, and put it on the valves' clock."""
    chain = chain_of(robot)
    labels, positions = _points(source, chain, options)
    axes, up = ground_axes(positions, options.up)
    seen = int(np.isfinite(positions[..., 0]).sum())
    cloud = to_ground(without_ghosts(positions, up, chain.pitch_m / 2), axes)
    found = best_start(chain, cloud)
    if found is None:
        raise InputError(
            f"{source.source}: no frame shows {chain.links} markers in a row, {chain.pitch_m:g} m apart "
            "(is it this robot, are the units right, is the ground plane seen from above?)"
        )
    frame, order = found
    owners = follow(chain, cloud, frame, order)
    tracks = take(cloud, owners)
    warnings: list[str] = []
    report = Report(Path("."))
    lag = row.number("phase_lag_rad", report, 0.0)
    if _reversed(chain, labels, order, tracks, lag, options.head_marker, warnings):
        tracks = np.ascontiguousarray(tracks[:, ::-1])
    start, start_sd = _valve_start(source, row, robot, tracks, options)
    trial = _cut(source, row, tracks, start, report)
    _check_turn(trial, warnings)
    ghosts = seen - int((owners >= 0).sum())
    note = TrialNote(trial.name, source.name, start, start_sd, trial.lost_fraction, ghosts, tuple(warnings))
    return trial, note


def _points(source: Take, chain: Chain, options: ImportOptions) -> tuple[tuple[str, ...], Array]:
    bodies = options.points == "bodies" or (options.points == "auto" and len(source.bodies) == chain.links)
    labels = source.bodies if bodies else source.markers
    if len(labels) < chain.links:
        kind = "rigid bodies" if bodies else "markers"
        raise InputError(f"{source.source}: holds {len(labels)} {kind}, the robot has {chain.links} links")
    return labels, source.body_positions_m if bodies else source.marker_positions_m


def _reversed(
    chain: Chain,
    labels: tuple[str, ...],
    order: np.ndarray,
    tracks: Array,
    lag: float,
    head: str | None,
    warnings: list[str],
) -> bool:
    """Whether the chain was found head first: by the head's label, else by where the robot goes."""
    if head is not None:
        ends = [labels[order[0]], labels[order[-1]]]
        if head not in ends:
            raise InputError(
                f"head marker '{head[:40]}' is not at an end of the robot (ends: {', '.join(ends)})"
            )
        return ends[0] == head
    seen = np.isfinite(tracks[:, :, 0]).all(axis=1)
    whole = tracks[seen]
    travel = whole[-1].mean(axis=0) - whole[0].mean(axis=0)
    axis = (whole[:, -1] - whole[:, 0]).mean(axis=0)
    along = float(travel @ axis) / max(float(np.linalg.norm(axis)), 1e-9)
    if abs(along) < chain.pitch_m:
        warnings.append("hardly moves, so head and tail cannot be told: check, or give --head-marker")
    return along * (-1.0 if lag < 0 else 1.0) < 0


def _valve_start(
    source: Take, row: Row, robot: Robot, tracks: Array, options: ImportOptions
) -> tuple[float, float | None]:
    if row.text("valve_start_s"):
        return float(row.text("valve_start_s")), None
    if options.valve_start_s is not None:
        return options.valve_start_s, None
    if row.text("kind") in ("still", "tow", "push"):
        return 0.0, None
    settings = (row.number(name, Report(Path("."))) for name in SETTINGS)
    onset = find_onset(robot, Gait(*settings), source.time_s, tracks)
    return onset.time_s, onset.sd_s


def _cut(source: Take, row: Row, tracks: Array, start: float, report: Report) -> Trial:
    """Cut the trial out of the take: from the valves' start, tail at the origin, room axes kept."""
    step = 1 / source.rate_hz
    time = source.time_s - start
    duration = row.number("duration_s", report, math.inf)
    window = (time >= -0.5 * step) & (time < duration - 0.5 * step)
    if window.sum() < 4:
        raise InputError(f"{source.source}: the valves start at {start:g} s, after the take's end")
    rest = tracks[source.time_s <= max(start, source.time_s[4])]
    seen = np.isfinite(rest[..., 0]).any(axis=0)
    if not seen[[0, -1]].all():
        raise InputError(f"{source.source}: tail or head is not seen before the valves start")
    tail, head = (np.nanmedian(rest[:, i], axis=0) for i in (0, -1))
    heading = math.atan2(head[1] - tail[1], head[0] - tail[0])
    values = {name: row.number(name, report, 0.0) for name in SETTINGS}
    return Trial(
        name=row.text("trial"),
        frequency_hz=values["frequency_hz"],
        pressure_kpa=values["pressure_kpa"],
        offset=values["offset"],
        phase_lag_rad=values["phase_lag_rad"],
        heading_rad=heading,
        duration_s=round(float(time[window][-1]) + step, 6),
        time_s=time[window],
        markers_m=tracks[window] - tail,
        tether=row.yes("tether", True, report),
        floor=row.text("floor") or None,
        replicate_of=row.text("replicate_of") or None,
        kind=row.text("kind") or "gait",
    )


def _check_turn(trial: Trial, warnings: list[str]) -> None:
    """A positive offset turns left: a robot that turns the other way was seen from below."""
    points = trial.markers_m
    if points is None or abs(trial.offset) < 0.15 or trial.kind != "gait":
        return
    axis = points[:, -1] - points[:, 0]
    angle = np.arctan2(axis[:, 1], axis[:, 0])
    angle = np.unwrap(angle[np.isfinite(angle)])
    turned = (
        float(angle[-len(angle) // 4 :].mean() - angle[: len(angle) // 4].mean()) if len(angle) > 8 else 0.0
    )
    if abs(turned) > 0.2 and turned * trial.offset < 0:
        warnings.append("turns against its offset: is the plane seen from above (--up), head and tail right?")

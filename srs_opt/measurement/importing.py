"""Recordings and a list of trials become a measured data set."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.chain import Chain, chain_of
from srs_opt.measurement.cutting import SETTINGS, check_rest, check_turn, cut_trial
from srs_opt.measurement.direction import head_first
from srs_opt.measurement.find_chain import best_start, symmetric
from srs_opt.measurement.frequency import far_frequency, seen_frequency
from srs_opt.measurement.ground import ground_axes, to_ground, without_ghosts
from srs_opt.measurement.labels import follow, take
from srs_opt.measurement.noise import noise_sd
from srs_opt.measurement.onset import Onset, find_onset, first_motion
from srs_opt.measurement.read import parse_schedule
from srs_opt.measurement.records import KINDS, Array, Bench, Check, DataSet, Schedule, Trial
from srs_opt.measurement.run_in import run_in_s
from srs_opt.measurement.spots import Spots
from srs_opt.measurement.take_settings import IMPORT, ONSET
from srs_opt.measurement.takes.take import Take
from srs_opt.measurement.valve_wave import ValveWave
from srs_opt.problem import Report
from srs_opt.robot import Robot
from srs_opt.table import Row, first_error, read_table

Points = Literal["auto", "markers", "bodies"]
OPTIONAL = (
    "take",
    "heading_rad",
    "duration_s",
    "valve_start_s",
    "schedule",
    "tether",
    "floor",
    "replicate_of",
    "kind",
)
SCALES = ((1.0, "metres"), (1e-3, "millimetres"), (1e-2, "centimetres"), (0.0254, "inches"))


@dataclass(frozen=True)
class ImportOptions:
    """How to read the takes.

    Attributes
    ----------
    head_marker : str or None
        Label of the head's marker; without it the bends' phases and the direction of motion tell.
    up : str
        Direction up in the system's axes (`srs_opt.measurement.ground.ground_axes`).
    points : {"auto", "markers", "bodies"}
        Follow markers, or the pivots of rigid bodies; auto takes bodies when there is one per link.
    valve_start_s : float or None
        Valves' start on the take's clock, for all takes; the trials' own column valve_start_s wins.
    marker_sd_m : float or None
        Noise of a coordinate; estimated from the tracks when not given.
    spots : tuple of Spot or None
        Where the markers sit, tail to head; None: one on every link's centre.
    """

    head_marker: str | None = None
    up: str = "auto"
    points: Points = "auto"
    valve_start_s: float | None = None
    marker_sd_m: float | None = None
    spots: Spots | None = None


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
    moving: bool = False


def read_trial_list(path: Path) -> list[Row]:
    """Read the list of trials: trial, frequency_hz, pressure_kpa, offset, phase_lag_rad and optional columns.

    Raises
    ------
    InputError
        For the first problem found, with the number of others.
    """
    rows, report = read_table(path, ("trial", *SETTINGS), OPTIONAL)
    lines: dict[str, int] = {}
    for row in rows:
        free = bool(row.text("schedule")) or row.text("kind") not in ("", "gait")
        for column in SETTINGS:
            row.number(column, report, 0.0 if free else None)
        for column in ("heading_rad", "duration_s", "valve_start_s"):
            row.number(column, report, 0.0)
        row.word("kind", KINDS, "gait", report)
        row.yes("tether", True, report)
        name = row.text("trial").casefold()
        if name in lines:
            report.error(row.file, row.line, f"trial '{name[:60]}' is already on line {lines[name]}")
        lines.setdefault(name, row.line)
    first_error(report)
    return rows


def read_schedules(folder: Path, rows: Sequence[Row], robot: Robot) -> dict[str, Schedule]:
    """Read the schedules that the list of trials names, from its folder or the folder schedules in it.

    Raises
    ------
    InputError
        If one is missing or faulty.
    """
    found: dict[str, Schedule] = {}
    for row in rows:
        text = row.text("schedule")
        if not text or text in found:
            continue
        name = text.removesuffix(".csv")
        places = [p for p in (folder / f"{name}.csv", folder / "schedules" / f"{name}.csv") if p.is_file()]
        if not places:
            raise InputError(f"{folder / row.file}:{row.line}: schedule: there is no file {name}.csv")
        report = Report(places[0].parent)
        schedule = parse_schedule(places[0].stem, places[0].name, robot, report)
        first_error(report)
        if schedule is not None:
            found[text] = schedule
    return found


def import_takes(
    takes: Sequence[Take],
    rows: Sequence[Row],
    robot: Robot,
    name: str,
    options: ImportOptions,
    schedules: Mapping[str, Schedule] | None = None,
) -> tuple[DataSet, tuple[TrialNote, ...]]:
    """Return the data set that takes and trials make, and a note on each trial.

    Raises
    ------
    InputError
        If a trial has no take, or the robot cannot be found in one.
    """
    rates = {round(t.rate_hz, 6) for t in takes}
    if max(rates) / min(rates) > 1 + IMPORT.same_rate_share:
        raise InputError(f"the takes have different frame rates ({', '.join(map(str, sorted(rates)))} Hz)")
    trials, notes = [], []
    for row in rows:
        key = row.text("take") or row.text("trial")
        found = _take_called(key, takes, row, alone=len(rows) == 1)
        trial, note = import_trial(found, row, robot, options, (schedules or {}).get(row.text("schedule")))
        trials.append(trial)
        notes.append(note)
    sds = [noise_sd(t.markers_m) for t in trials if t.markers_m is not None]
    sd = options.marker_sd_m or max(float(np.median(sds)), 1e-6)
    spreads = [n.valve_start_sd_s for n in notes if n.valve_start_sd_s is not None and not n.moving]
    checks = (Check("clock_alignment_s", 0.0, float(np.median(spreads))),) if spreads else ()
    dataset = DataSet(
        name=name,
        robot=robot,
        rate_hz=takes[0].rate_hz,
        # more digits are not known
        marker_sd_m=float(f"{sd:.3g}"),
        trials=tuple(trials),
        bench=Bench(checks=checks),
    )
    return dataset, tuple(notes)


def _take_called(key: str, takes: Sequence[Take], row: Row, *, alone: bool) -> Take:
    """Return the take of a trial: by the file's name first, more often unique than the take's own."""
    for named in (lambda t: (t.source.name, t.source.stem), lambda t: (t.name,)):
        found = [t for t in takes if key in named(t)]
        if len(found) > 1:
            files = ", ".join(str(t.source) for t in found)
            raise InputError(
                f"{row.file}:{row.line}: {len(found)} takes are called '{key[:60]}' ({files}); "
                "name the file in the column take"
            )
        if found:
            return found[0]
    if alone and len(takes) == 1:
        return takes[0]
    known = ", ".join(sorted({t.source.stem for t in takes}))
    raise InputError(f"{row.file}:{row.line}: no take is called '{key[:60]}' (takes: {known})")


def import_trial(
    source: Take, row: Row, robot: Robot, options: ImportOptions, schedule: Schedule | None = None
) -> tuple[Trial, TrialNote]:
    """Find the robot in one take, order its markers tail to head, and put it on the valves' clock."""
    chain = chain_of(robot, options.spots)
    warnings: list[str] = list(source.told)
    labels, positions = _points(source, chain, options)
    cloud, found = _scaled(source, chain, positions, options.up, warnings)
    counts = np.isfinite(positions[..., 0]).sum(axis=1)
    seen, usual = int(counts.sum()), int(np.median(counts[counts > 0]))
    if usual > chain.markers:
        raise InputError(
            f"{source.source}: most frames show {usual} positions, {_expected(chain)}; "
            "say with --markers where they sit, or leave the others out (a table: --columns)"
        )
    frame, order = found
    owners = follow(chain, cloud, frame, order)
    tracks = take(cloud, owners)
    report = Report(Path("."))
    ends = (labels[order[0]], labels[order[-1]])
    values = [row.number(name, report, 0.0) for name in SETTINGS]
    if schedule is not None:
        values[0] = 1 / schedule.period_s
    # the frequency first: head and tail are told by phases at it, the valves' start by the wave
    gait = _seen_gait(
        ValveWave(values[0], values[1], values[2], values[3], schedule), source.time_s, tracks, warnings
    )
    backwards = head_first(
        chain,
        ends,
        source.time_s,
        tracks,
        gait.frequency_hz,
        gait.phase_lag_rad,
        options.head_marker,
        warnings,
    )
    if backwards and symmetric(chain):
        tracks = np.ascontiguousarray(tracks[:, ::-1])
    elif backwards:
        warnings.append("the markers' spacing says which end is the tail, and their motion says otherwise")
    onset = _valve_start(source, row, robot, tracks, options, gait, warnings)
    if onset.moving:
        warnings.append(
            "the take begins in mid-gait: the fits let the robot run in, and fit where it was and the phase"
        )
    trial = cut_trial(source, row, chain, tracks, onset, gait)
    check_rest(trial, warnings)
    check_turn(trial, warnings)
    ghosts = seen - int((owners >= 0).sum())
    sd = None if math.isnan(onset.sd_s) else onset.sd_s
    note = TrialNote(
        trial.name, source.name, onset.time_s, sd, trial.lost_fraction, ghosts, tuple(warnings), trial.moving
    )
    return trial, note


def _points(source: Take, chain: Chain, options: ImportOptions) -> tuple[tuple[str, ...], Array]:
    bodies = options.points == "bodies" or (options.points == "auto" and len(source.bodies) == chain.markers)
    labels = source.bodies if bodies else source.markers
    positions = source.body_positions if bodies else source.marker_positions
    if len(labels) < chain.markers or positions is None:
        kind = "rigid bodies" if bodies else "markers"
        raise InputError(
            f"{source.source}: holds {len(labels)} {kind}, {_expected(chain)}; "
            "say with --markers where they sit"
        )
    return labels, positions


def _expected(chain: Chain) -> str:
    """Return how many markers there should be, in words."""
    if chain.spots is None:
        return f"the robot has {chain.links} links (one marker on the centre of each is expected)"
    return f"--markers lists {chain.markers}"


def _scaled(
    source: Take, chain: Chain, positions: Array, up: str, warnings: list[str]
) -> tuple[Array, tuple[int, np.ndarray]]:
    """Return positions in the ground plane in metres, and where the chain was found.

    A scale that the file does not tell is the unit in which a chain is found.

    Raises
    ------
    InputError
        If no frame shows the robot.
    """
    axes, normal = ground_axes(positions, "z" if source.flat and up == "auto" else up)
    if source.scale_m is None and source.pixels:
        raise InputError(f"{source.source}: positions in pixels; give --scale M{_pixels(chain, positions)}")
    scales = ((source.scale_m, ""),) if source.scale_m else SCALES
    for scale, unit in scales:
        metres = positions * scale
        cloud = to_ground(without_ghosts(metres, normal, chain.pitch_m / 2), axes)
        found = best_start(chain, cloud)
        if found is not None:
            if unit:
                warnings.append(f"the file states no units: taken as {unit}, for the markers' spacing")
            return cloud, found
    spacing = sorted({float(f"{d:.3g}") for d in chain.spacing_m})
    raise InputError(
        f"{source.source}: no frame shows {chain.markers} markers in a row, "
        f"{' or '.join(f'{d:g}' for d in spacing[:4])} m apart "
        f"(is it this robot, are the units right, is the ground plane seen from above?)"
    )


def _pixels(chain: Chain, positions: Array) -> str:
    """Return what the spacing of neighbouring columns makes of a picture's scale, in words."""
    chords = np.linalg.norm(np.diff(positions, axis=1), axis=2)
    if not np.isfinite(chords).any():
        return ""
    scale = float(chain.spacing_m.max()) / float(np.nanquantile(chords, 0.9))
    return f" per pixel (from the markers' spacing it would be about {scale:.2g}; better from a ruler)"


def _valve_start(
    source: Take,
    row: Row,
    robot: Robot,
    tracks: Array,
    options: ImportOptions,
    gait: ValveWave,
    warnings: list[str],
) -> Onset:
    """Return when the valves started, or, where a take begins in motion, may be taken to have started."""
    if row.text("kind") in ("still", "tow", "push"):
        return Onset(0.0, math.nan)
    first = float(source.time_s[0])
    told = float(row.text("valve_start_s")) if row.text("valve_start_s") else options.valve_start_s
    if told is not None:
        moving = told < first - 0.5 / source.rate_hz
        if moving and gait.frequency_hz > 0:  # whole cycles that left no trace need not be simulated
            spare = first - told - run_in_s(gait.frequency_hz)
            told += max(0, math.floor(spare * gait.frequency_hz)) / gait.frequency_hz
        return Onset(told, math.nan, moving=moving)
    if row.text("kind") == "step":
        moved = first_motion(tracks.reshape(len(tracks), -1), noise_sd(tracks))
        if moved is None:
            raise InputError(f"{source.source}: the markers never move (kind step): give valve_start_s")
        # a few frames at rest tell the curvature before; the step's fit finds its own delay
        return Onset(max(float(source.time_s[moved]) - IMPORT.before_step_s, first), math.nan)
    onset = find_onset(robot, gait, source.time_s, tracks, options.spots)
    if onset.doubt:
        known = "phase of the valves" if onset.moving else "start"
        source_of_it = "cycle" if onset.moving else "first motion"
        warnings.append(
            f"{onset.doubt}: the {known} is known from the {source_of_it} alone; give valve_start_s"
        )
    return onset


def _seen_gait(gait: ValveWave, time_s: Array, tracks: Array, warnings: list[str]) -> ValveWave:
    """Return the gait at the frequency that the bends show, where it is not the one listed."""
    if gait.frequency_hz <= 0:
        return gait
    moving = first_motion(tracks.reshape(len(tracks), -1), noise_sd(tracks)) or 0
    # the bends' build-up after the start is not periodic
    running = time_s > time_s[moving] + (IMPORT.settled_s if moving > ONSET.quiet_frames else 0.0)
    seen = seen_frequency(time_s[running], tracks[running], gait.frequency_hz)
    if seen is None and (far := far_frequency(time_s[running], tracks[running], gait.frequency_hz)):
        warnings.append(f"the bends repeat at about {far:.3g} Hz; {gait.frequency_hz:g} Hz is listed: which?")
    if seen is None or not seen.differs(gait.frequency_hz, float(np.ptp(time_s))):
        return gait
    words = (
        f"the bends repeat at {seen.value_hz:.5g} Hz (sd {seen.sd_hz:.1g}), not at {gait.frequency_hz:g} Hz"
    )
    if gait.schedule is not None:
        warnings.append(f"{words}: does the clock of the schedule run as the camera's?")
        return gait
    warnings.append(f"{words}: taken as seen")
    return replace(gait, frequency_hz=float(f"{seen.value_hz:.7g}"))

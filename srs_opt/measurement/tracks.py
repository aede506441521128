"""Camera tracks of one trial: reading, and checks of clock, units, order and losses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from srs_opt.geometry import rotation_matrix
from srs_opt.measurement.chain import Chain, chain_of
from srs_opt.measurement.noise import noise_sd
from srs_opt.measurement.plausible import factor_of_thousand
from srs_opt.measurement.records import TAIL_TO_HEAD, Array, Trial
from srs_opt.measurement.take_settings import TRACK_CHECK
from srs_opt.problem import Report
from srs_opt.robot import Robot
from srs_opt.table import NumberTable, read_numbers


@dataclass(frozen=True, eq=False)
class Track:
    """Samples as the file has them: times (T,), points (T, P, 2) with NaN where lost, line of each sample."""

    file: str
    time_s: Array
    points_m: Array
    lines: tuple[int, ...] | range


def track_columns(markers: str, count: int) -> tuple[str, ...]:
    """Return the columns of a track file with `count` markers."""
    if markers != TAIL_TO_HEAD:
        return ("time_s", "x_m", "y_m")
    return ("time_s", *(f"{axis}{i}_m" for i in range(1, count + 1) for axis in "xy"))


def read_track(file: str, markers: str, chain: Chain, report: Report) -> Track | None:
    """Read one track; None (and a report) when nothing can be made of it."""
    table = read_numbers(file, report)
    if table is None:
        if not any(p.file == file for p in report.problems):
            report.error(file, None, "holds no rows")
        return None
    expected = track_columns(markers, chain.markers)
    if table.header != expected:
        _report_columns(file, table, expected, markers, chain, report)
        return None
    time = table.values[:, 0]
    points = np.ascontiguousarray(table.values[:, 1:].reshape(len(time), -1, 2))
    points, time = points.copy(), time.copy()
    far = np.argwhere(np.abs(points) > TRACK_CHECK.farthest_m)
    if far.size:
        frame, marker, axis = far[0]
        report.error(
            file,
            table.lines[frame],
            f"marker {marker + 1} stands {points[frame, marker, axis]:.3g} m from the origin "
            f"(expected at most {TRACK_CHECK.farthest_m:g} m; are these millimetres?)",
        )
        # the other checks would overflow
        points[(np.abs(points) > TRACK_CHECK.farthest_m).any(axis=2)] = np.nan
    half = np.isnan(points).any(axis=2) & ~np.isnan(points).all(axis=2)
    if half.any():
        frame, marker = np.argwhere(half)[0]
        report.warn(file, table.lines[frame], f"marker {marker + 1} has one coordinate of two; taken as lost")
        points[half] = np.nan
    time.flags.writeable = points.flags.writeable = False
    return Track(file, time, points, table.lines)


def _report_columns(
    file: str, table: NumberTable, expected: tuple[str, ...], markers: str, chain: Chain, report: Report
) -> None:
    found = (len(table.header) - 1) / 2
    if markers == TAIL_TO_HEAD and found == int(found) and found != chain.markers:
        why = (
            f"the robot has {chain.links} links (robot.yaml)"
            if chain.spots is None
            else f"dataset.yaml lists {chain.markers}"
        )
        report.error(file, 1, f"has {int(found)} markers where {why}")
        return
    for name in expected:
        if name not in table.header:
            report.error(file, 1, f"column '{name}' is missing (expected {', '.join(expected[:3])}, ...)")
    for name in table.header:
        if name not in expected:
            report.error(file, 1, f"column '{name[:40]}' is not part of a {markers} track")
    if set(table.header) == set(expected):
        report.error(file, 1, f"columns are out of order (expected {', '.join(expected[:3])}, ...)")


def check_track(
    trial: Trial, track: Track, robot: Robot, rate_hz: float, marker_sd_m: float, report: Report
) -> None:
    """Report what is implausible about a track."""
    lost = np.isnan(track.points_m[..., 0])
    if lost.all():
        # the other trials are none the worse for it: fits leave this one out and say so
        report.warn(track.file, None, "every marker is lost in every frame: the trial holds no measurement")
        return
    good_clock = _check_clock(trial, track, rate_hz, report)
    for marker in np.flatnonzero(lost.all(axis=0)):
        report.warn(track.file, None, f"marker {marker + 1} is never seen")
    if lost.mean() > TRACK_CHECK.most_lost_share:
        report.warn(track.file, None, f"{100 * lost.mean():.0f} % of the marker positions are lost")
    if track.points_m.shape[1] > 1:
        chain = chain_of(robot, trial.spots)
        good_units = _check_spacing(track, chain, report)
        if good_units:
            _check_start(trial, track, chain, robot.length_m, report)
    else:
        good_units = _check_speed(track, robot, good_clock, report)
    if good_units:
        _check_noise(track, marker_sd_m, report)


def _check_clock(trial: Trial, track: Track, rate_hz: float, report: Report) -> bool:
    time, file, lines = track.time_s, track.file, track.lines
    for row in np.flatnonzero(np.isnan(time)):
        report.error(file, lines[row], "time_s: expected a number, found an empty cell or nan")
    if np.isnan(time).any():
        return False
    if len(time) < 2:
        report.error(file, None, "has a single sample")
        return False
    steps = np.diff(time)
    step = 1 / rate_hz if rate_hz > 0 else float(np.median(steps))
    typical = float(np.median(steps))
    scale = factor_of_thousand(typical / step) if typical > 0 else ""
    if typical > 0 and abs(typical / step - 1) >= TRACK_CHECK.rate_share:
        reason = f"time_s in {scale}seconds?" if scale else "is camera.rate_hz right?"
        report.error(
            file, lines[0], f"samples lie {typical:g} s apart and camera.rate_hz says {step:g} s: {reason}"
        )
        return False
    fine = True
    for row in np.flatnonzero(np.abs(steps - step) > 0.25 * step):
        fine = _report_step(float(steps[row]), step, file, lines[row + 1], report) and fine
    if abs(time[0]) > 0.5 * step and not trial.moving:
        report.warn(file, lines[0], f"the first sample is labelled {time[0]:g} s, expected 0")
    _check_duration(trial, float(time[-1] - time[0]) + step, step, file, lines[-1], report)
    return fine


def _report_step(found: float, step: float, file: str, line: int, report: Report) -> bool:
    if found <= 0:
        words = "goes backwards" if found < 0 else "stands still"
        report.error(file, line, f"time_s: the clock {words} ({found:+.6g} s)")
        return False
    missing = round(found / step) - 1
    if 1 <= missing <= TRACK_CHECK.most_missing_rows and abs(found / step - missing - 1) < 0.25:
        report.warn(file, line, f"time_s: {missing} frame(s) are missing before this one")
        return True
    many = missing > TRACK_CHECK.most_missing_rows
    hint = "; if frames were lost, give them rows with empty cells" if many else ""
    report.error(file, line, f"time_s: the clock jumps by {found:.6g} s, expected {step:.6g} s{hint}")
    return False


def _check_duration(trial: Trial, span: float, step: float, file: str, line: int, report: Report) -> None:
    wanted = trial.duration_s
    if not wanted > 0 or abs(span - wanted) <= max(2.5 * step, 0.01 * wanted):
        return
    scale = factor_of_thousand(wanted / span)
    message = f"the track lasts {span:.4g} s and trials.csv says duration_s {wanted:g}"
    if scale:
        report.error(file, line, f"{message}: {scale}seconds there?")
    elif abs(span - wanted) > TRACK_CHECK.most_off_duration * wanted:
        report.error(file, line, message)
    else:
        report.warn(file, line, message)


def _check_spacing(track: Track, chain: Chain, report: Report) -> bool:
    chords = np.linalg.norm(np.diff(track.points_m, axis=1), axis=2)
    if np.isnan(chords).all():
        return True
    ratio = float(np.nanquantile(chords / chain.spacing_m, 0.75))
    if TRACK_CHECK.spacing[0] < ratio < TRACK_CHECK.spacing[1]:
        return True
    spacing = float(chain.spacing_m.mean())
    found = ratio * spacing
    scale = factor_of_thousand(ratio)
    units = {"milli": "millimetres", "kilo": "kilometres", "micro": "micrometres"}
    if scale:
        why = f"positions in {units.get(scale, 'other units')}, expected metres?"
    elif 80 < ratio < 120:
        why = "positions in centimetres, expected metres?"
    elif 33 < ratio < 45:
        why = "positions in inches, expected metres?"
    else:
        why = "are the markers in order, tail to head, and is it this robot?"
    whose = "the robot's pitch is" if chain.spots is None else "robot and markers say"
    message = f"neighbouring markers lie {found:.3g} m apart where {whose} {spacing:.3g} m: {why}"
    report.error(track.file, track.lines[0], message)
    return False


def _check_start(trial: Trial, track: Track, chain: Chain, length_m: float, report: Report) -> None:
    """The robot starts straight along heading_rad with its tail at the origin."""
    points = track.points_m
    tail, head = points[:10, 0], points[:10, -1]
    if (
        np.isnan(tail[:, 0]).all()
        or np.isnan(head[:, 0]).all()
        or (trial.moving or trial.kind in ("tow", "push", "step"))
    ):
        return
    start = np.nanmean(tail, axis=0)
    along = np.nanmean(head, axis=0) - start
    straight = chain.straight_m[-1] - chain.straight_m[0]
    heading = math.atan2(along[1], along[0]) - math.atan2(straight[1], straight[0])
    gap = math.remainder(heading - trial.heading_rad, 2 * math.pi)
    degrees = math.remainder(heading - math.radians(trial.heading_rad), 2 * math.pi)
    start = start - rotation_matrix(heading) @ chain.straight_m[0]
    limit = TRACK_CHECK.most_off_start_rad
    if abs(gap) > 2.9 and abs(degrees) > limit:
        report.error(track.file, track.lines[0], "the markers run head to tail, expected tail to head")
    elif abs(gap) > limit:
        hint = " (given in degrees?)" if abs(degrees) < limit else ""
        message = f"the robot starts {gap:+.2f} rad away from its heading_rad {trial.heading_rad:g}{hint}"
        report.warn(track.file, track.lines[0], message)
    if np.linalg.norm(start) > length_m:
        message = f"the tail starts at ({start[0]:.3g}, {start[1]:.3g}) m, expected the origin"
        report.warn(track.file, track.lines[0], message)


def _check_speed(track: Track, robot: Robot, good_clock: bool, report: Report) -> bool:
    """A centre-of-mass track has no length of its own: its speed must stand in."""
    points, time = track.points_m[:, 0], track.time_s
    seen = np.flatnonzero(~np.isnan(points[:, 0]))
    if len(seen) < 2 or not good_clock:
        return True
    span = float(time[seen[-1]] - time[seen[0]])
    extent = float(np.ptp(points[seen], axis=0).max())
    limit = TRACK_CHECK.top_speed_body * robot.length_m
    if extent / max(span, 1e-9) <= limit:
        return True
    message = (
        f"the robot covers {extent:.3g} m in {span:.3g} s, above {limit:.2g} m/s: positions in millimetres?"
    )
    report.error(track.file, track.lines[0], message)
    return False


def _check_noise(track: Track, marker_sd_m: float, report: Report) -> None:
    """Compare the noise that the tracks show with the one that dataset.yaml states."""
    if not marker_sd_m > 0:
        return
    ratio = noise_sd(track.points_m, TRACK_CHECK.least_differences) / marker_sd_m
    message = f"marker noise is {ratio:.2g} times camera.marker_sd_m ({marker_sd_m:g} m)"
    factor = max(ratio, 1 / ratio) if ratio > 0 else 1.0
    if factor > TRACK_CHECK.impossible_noise:
        report.error(track.file, None, f"{message}: units?")
    elif factor > TRACK_CHECK.odd_noise:
        report.warn(track.file, None, message)

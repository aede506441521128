"""A trial cut out of a take: on the valves' clock, tail at the origin."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from srs_opt.errors import InputError
from srs_opt.geometry import rotation_matrix, turning_angles
from srs_opt.measurement.chain import Chain
from srs_opt.measurement.onset import Onset
from srs_opt.measurement.records import Array, Trial
from srs_opt.measurement.take_settings import IMPORT
from srs_opt.measurement.takes.take import Take
from srs_opt.measurement.valve_wave import ValveWave
from srs_opt.problem import Report
from srs_opt.table import Row

SETTINGS = ("frequency_hz", "pressure_kpa", "offset", "phase_lag_rad")


def cut_trial(
    source: Take,
    row: Row,
    chain: Chain,
    tracks: Array,
    onset: Onset,
    gait: ValveWave,
) -> Trial:
    """Cut the trial out of the take: from the valves' start, tail at the origin, room axes kept.

    A take that begins in mid-gait is kept from its first frame, which is labelled with the time since the
    valves started or may be taken to have.
    """
    report, start = Report(Path(".")), onset.time_s
    step = 1 / source.rate_hz
    time = source.time_s - start
    duration = row.number("duration_s", report, math.inf)
    begin = float(time[0]) if onset.moving else 0.0
    # half a frame of slack: a frame belongs to the trial whatever rounding does to its label
    window = (time >= begin - 0.5 * step) & (time < begin + duration - 0.5 * step)
    if window.sum() < 4:
        raise InputError(f"{source.source}: the valves start at {start:g} s, after the take's end")
    rest = tracks[source.time_s <= max(start, source.time_s[4])]
    seen = np.isfinite(rest[..., 0]).any(axis=0)
    if not seen[[0, -1]].all():
        raise InputError(f"{source.source}: tail or head is not seen before the valves start")
    tail, heading = _resting_pose(chain, np.stack([np.nanmedian(rest[:, i], axis=0) for i in (0, -1)]))
    return Trial(
        name=row.text("trial"),
        frequency_hz=gait.frequency_hz,
        pressure_kpa=gait.pressure_kpa,
        offset=gait.offset,
        phase_lag_rad=gait.phase_lag_rad,
        heading_rad=heading,
        duration_s=round(float(time[window][-1]) - begin + step, 6),
        time_s=time[window],
        markers_m=tracks[window] - tail,
        schedule=gait.schedule,
        tether=row.yes("tether", True, report),
        floor=row.text("floor") or None,
        replicate_of=row.text("replicate_of") or None,
        kind=row.text("kind") or "gait",
        spots=chain.spots,
        moving=onset.moving,
    )


def _resting_pose(chain: Chain, ends: Array) -> tuple[Array, float]:
    """Return where the straight robot's tail link is and its heading, from the outermost markers (2, 2)."""
    straight = chain.straight_m[[0, -1]]
    along, own = ends[1] - ends[0], straight[1] - straight[0]
    heading = math.atan2(along[1], along[0]) - math.atan2(own[1], own[0])
    return ends[0] - rotation_matrix(heading) @ straight[0], math.remainder(heading, 2 * math.pi)


def check_rest(trial: Trial, warnings: list[str]) -> None:
    """The fits take a robot for straight and at rest when its valves start."""
    points = trial.markers_m
    if points is None or trial.kind != "gait" or trial.moving:
        return
    bends = np.abs(turning_angles(points[:3]))
    if np.isfinite(bends).any() and float(np.nanmax(bends)) > IMPORT.most_bent_rad:
        warnings.append(
            f"the robot is bent by {np.nanmax(bends):.2g} rad at the valves' start: the fits "
            "take it for straight and at rest then (if it was in mid-gait, give an earlier valve_start_s)"
        )


def check_turn(trial: Trial, warnings: list[str]) -> None:
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

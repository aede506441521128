"""What was seen and played, kept as a data set that calibrate and discrepancy take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planners.pilot.observer import straight_pose
from planners.pilot.pose import Sighting
from srs_opt.errors import NoAnswerError
from srs_opt.files import write_text
from srs_opt.measurement.chain import chain_of
from srs_opt.measurement.records import CENTRE_OF_MASS, TAIL_TO_HEAD
from srs_opt.robot import Robot, save_robot
from srs_opt.simulate.timeline import Timeline

MARKER_SD_M = 0.001  # written into the set until its noise is measured


@dataclass
class DriveLog:
    """Sightings and valves of one drive, times on the pilot's clock.

    Attributes
    ----------
    sightings : list of Sighting
    valves : list of (time_s, states, pressure_kpa)
        From then on; states is the (N-1,) array of S.
    """

    sightings: list[Sighting] = field(default_factory=list)
    valves: list[tuple[float, np.ndarray, float]] = field(default_factory=list)

    def seen(self, sightings: Sequence[Sighting]) -> None:
        """Keep sightings."""
        self.sightings += sightings

    def played(self, begin_s: float, timeline: Timeline) -> None:
        """Keep what the valves do from `begin_s` on, in place of what they were to do."""
        self.valves = [entry for entry in self.valves if entry[0] < begin_s - 1e-9]
        starts = begin_s + np.concatenate([[0.0], np.cumsum(timeline.duration_s)[:-1]])
        for k, start in enumerate(starts):
            self.valves.append((float(start), timeline.valve[:, k].copy(), float(timeline.pressure_kpa[k])))

    def states_at(self, time_s: float, segments: int) -> np.ndarray:
        """Return S of every segment at a time, (N-1,); vented before the first entry."""
        states = [s for at, s, _ in self.valves if at <= time_s]
        return states[-1].astype(int) if states else np.zeros(segments, dtype=int)

    @property
    def begin_s(self) -> float:
        """When the valves first moved."""
        return self.valves[0][0]


def write_dataset(log: DriveLog, folder: Path, robot: Robot, latency_s: float) -> Path:
    """Write a drive as a data set of one trial, ``drive``, with the valves' pressures in ``drives/``.

    Time 0 is the valves' first switch; sightings are earlier than their stamps by `latency_s`. Places are
    moved so that the tail lies at the origin then.

    Raises
    ------
    NoAnswerError
        If the valves never moved or nothing was seen.
    """
    from srs_opt.measurement.tracks import track_columns

    if not log.valves or not log.sightings:
        raise NoAnswerError("the robot never moved: there is no data set to write")
    seen = [s for s in log.sightings if s.time_s - latency_s >= log.begin_s]
    before = [s for s in log.sightings if s.time_s - latency_s < log.begin_s] or seen[:1]
    chain = chain_of(robot)
    x, y, heading = np.median([straight_pose(s, chain, 0.0) for s in before[-30:]], axis=0)
    half = chain.pitch_m * (chain.links - 1) / 2
    tail = np.array([x - half * np.cos(heading), y - half * np.sin(heading)])
    time_s = np.array([s.time_s for s in seen]) - latency_s - log.begin_s
    markers = all(s.markers_m is not None for s in seen)
    points = np.array([s.markers_m if markers else s.pose[None, :2] for s in seen]) - tail  # type: ignore[index]
    duration_s = float(time_s[-1])
    order = TAIL_TO_HEAD if markers else CENTRE_OF_MASS
    rows = [",".join(track_columns(order, chain.links))]
    for at, place in zip(time_s, points):
        rows.append(",".join([f"{at:.6f}", *("" if np.isnan(v) else f"{v:.6f}" for v in place.ravel())]))
    write_text(folder / "trials" / "drive.csv", "\n".join(rows) + "\n")
    write_text(folder / "drives" / "drive.csv", _drive_table(log))
    columns = "trial,frequency_hz,pressure_kpa,offset,phase_lag_rad,heading_rad,duration_s,kind"
    pressure = max(p for _, _, p in log.valves)
    row = f"drive,0,{pressure:g},0,0,{heading:.6f},{duration_s:.6f},gait"
    write_text(folder / "trials.csv", f"{columns}\n{row}\n")
    save_robot(robot, folder / "robot.yaml")
    rate = (len(time_s) - 1) / duration_s
    header = (
        f"name: drive\nrobot: robot.yaml\ncamera:\n  rate_hz: {rate:.3f}\n  marker_sd_m: {MARKER_SD_M:g}\n"
        f"markers: {order}\n"
    )
    write_text(folder / "dataset.yaml", header)  # last: an interrupted write does not look like a set
    return folder


def _drive_table(log: DriveLog) -> str:
    """Return the chambers' pressures from each switch on, time 0 at the first."""
    segments = log.valves[0][1].size
    names = [f"{side}{k}_kpa" for k in range(1, segments + 1) for side in ("left", "right")]
    rows = [",".join(["time_s", *names])]
    for time_s, states, pressure in log.valves:
        sides = [f"{max(s, 0) * pressure:g},{max(-s, 0) * pressure:g}" for s in states]
        rows.append(",".join([f"{time_s - log.begin_s:.6f}", *sides]))
    return "\n".join(rows) + "\n"

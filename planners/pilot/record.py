"""What was seen and played, kept as a data set that calibrate and discrepancy take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planners.pilot.observer import straight_pose
from planners.pilot.pose import Sighting
from planners.pilot.settings import OBSERVER
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.chain import chain_of
from srs_opt.measurement.dataset import write_dataset as save
from srs_opt.measurement.records import CENTRE_OF_MASS, TAIL_TO_HEAD, Applied, Bench, DataSet, Trial
from srs_opt.robot import Robot
from srs_opt.simulate.timeline import Timeline


@dataclass
class DriveLog:
    """Sightings and valves of one drive, times on the pilot's clock.

    Attributes
    ----------
    sightings : list of Sighting
    valves : list of (time_s, states, pressure_kpa)
        From then on; states is the (N-1,) array of S.
    rhythm_hz : list of float
        Frequencies of the gaits played.
    """

    sightings: list[Sighting] = field(default_factory=list)
    valves: list[tuple[float, np.ndarray, float]] = field(default_factory=list)
    rhythm_hz: list[float] = field(default_factory=list)

    def seen(self, sightings: Sequence[Sighting]) -> None:
        """Keep sightings."""
        self.sightings += sightings

    def played(self, begin_s: float, timeline: Timeline) -> None:
        """Keep what the valves do from `begin_s` on, in place of what they were to do."""
        self.valves = [entry for entry in self.valves if entry[0] < begin_s - 1e-9]
        if timeline.valve.any():
            self.rhythm_hz.append(float(timeline.frequency_hz[0]))
        starts = begin_s + np.concatenate([[0.0], np.cumsum(timeline.duration_s)[:-1]])
        for k, start in enumerate(starts):
            self.valves.append((float(start), timeline.valve[:, k].copy(), float(timeline.pressure_kpa[k])))

    def states_at(self, time_s: float, segments: int) -> np.ndarray:
        """Return S of every segment at a time, (N-1,); vented before the first entry."""
        states = [s for at, s, _ in self.valves if at <= time_s]
        return states[-1].astype(int) if states else np.zeros(segments, dtype=int)

    @property
    def frequency_hz(self) -> float:
        """Mean rhythm of what was played (effects of the supply depend on it)."""
        return float(np.mean(self.rhythm_hz)) if self.rhythm_hz else 1.0

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
    points = np.array([s.markers_m if markers else s.pose[:2] for s in seen]) - tail  # type: ignore[index]
    pressure_kpa = np.array([p for _, _, p in log.valves])
    applied = Applied(
        np.array([at for at, _, _ in log.valves]) - log.begin_s,
        np.array([states for _, states, _ in log.valves], dtype=float),
        pressure_kpa,
    )
    trial = Trial(
        name="drive",
        frequency_hz=log.frequency_hz,
        pressure_kpa=float(pressure_kpa.max()),
        offset=0.0,
        phase_lag_rad=0.0,
        heading_rad=float(heading),
        duration_s=float(time_s[-1]),
        time_s=time_s,
        markers_m=points if markers else None,
        centre_m=None if markers else points,
        applied=applied,
    )
    rate = (len(time_s) - 1) / float(time_s[-1])
    order = TAIL_TO_HEAD if markers else CENTRE_OF_MASS
    return save(
        DataSet("drive", robot, rate, OBSERVER.recorded_marker_m, order, (trial,), (), Bench(), folder),
        folder,
    )

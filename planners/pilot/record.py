"""What was seen and played, kept as a data set that calibrate and discrepancy take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from planners.pilot.pose import Sighting
from srs_opt.simulate.timeline import Timeline


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
        """Keep what the valves do from `begin_s` on."""
        self.valves = [entry for entry in self.valves if entry[0] < begin_s - 1e-9]
        starts = begin_s + np.concatenate([[0.0], np.cumsum(timeline.duration_s)[:-1]])
        for k, start in enumerate(starts):
            self.valves.append((float(start), timeline.valve[:, k].copy(), float(timeline.pressure_kpa[k])))

    @property
    def begin_s(self) -> float:
        """When the valves first moved."""
        return self.valves[0][0] if self.valves else 0.0

    def write_drive(self, path: Path) -> Path:
        """Write the valves as a table of chamber pressures over time (time 0: the first switch)."""
        from srs_opt.files import write_text

        segments = self.valves[0][1].size if self.valves else 0
        names = [f"{side}{k}_kpa" for k in range(1, segments + 1) for side in ("left", "right")]
        rows = [",".join(["time_s", *names])]
        for time_s, states, pressure in self.valves:
            sides = [f"{max(s, 0) * pressure:g},{max(-s, 0) * pressure:g}" for s in states]
            rows.append(",".join([f"{time_s - self.begin_s:.6f}", *sides]))
        return write_text(path, "\n".join(rows) + "\n")

"""Where the robot is, as cameras tell it: sightings from a source, put on the pilot's clock.

A source sends the pose (centre of mass of the links, mean heading) or, better, the link centres from
tail to head.
"""

from __future__ import annotations

import json
import math
from collections import deque
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from planners.pilot.settings import OBSERVER
from srs_opt.errors import InputError

Array = NDArray[np.float64]
LARGEST_M = 1e3  # a coordinate beyond this is no place in a laboratory


@dataclass(frozen=True)
class Report:
    """One report of a source, as it came.

    Attributes
    ----------
    arrived_s : float
        On the pilot's clock.
    stamp_s : float or None
        The sender's own time of the picture; any origin.
    pose : (3,) array or None
        Centre of mass (m) and mean heading (rad).
    markers_m : (N, 2) array or None
        Link centres, tail to head; NaN where lost.
    """

    arrived_s: float
    stamp_s: float | None
    pose: Array | None
    markers_m: Array | None


@dataclass(frozen=True)
class Sighting:
    """A pose or the markers at a time on the pilot's clock (see `Report`)."""

    time_s: float
    pose: Array | None
    markers_m: Array | None


class PoseSource(Protocol):
    """Where reports come from."""

    def poll(self) -> list[Report]:
        """Return what has come since the last call, without waiting."""

    def close(self) -> None:
        """Let the source go."""


def parse_report(text: str | bytes, arrived_s: float, links: int) -> Report:
    """Return the report of one JSON line.

    The line is an object with ``x_m``, ``y_m``, ``heading_rad``, or with ``markers_m`` (a list of ``[x, y]``,
    tail to head, null where lost), and in either case, if the sender has a clock, ``t_s``.

    Raises
    ------
    InputError
        For anything else; the message quotes it.
    """
    shown = text[:80] if isinstance(text, str) else text[:80].decode("utf-8", "replace")
    try:
        record = json.loads(text)
    except (ValueError, UnicodeDecodeError) as error:
        raise InputError(f"pose line: expected JSON, found {shown!r}") from error
    if not isinstance(record, dict):
        raise InputError(f"pose line: expected an object with x_m, y_m, heading_rad, found {shown!r}")
    stamp = record.get("t_s")
    if stamp is not None and not _is_number(stamp):
        raise InputError(f"pose line: t_s: expected seconds, found {stamp!r}")
    if "markers_m" in record:
        return Report(arrived_s, stamp, None, _markers(record["markers_m"], links))
    values: list[Any] = [record.get(key) for key in ("x_m", "y_m", "heading_rad")]
    if not all(_is_number(v) and abs(v) < LARGEST_M for v in values):
        raise InputError(f"pose line: expected x_m, y_m, heading_rad as numbers, found {shown!r}")
    return Report(arrived_s, stamp, np.array(values, dtype=float), None)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _markers(value: Any, links: int) -> Array:
    if not isinstance(value, list) or len(value) != links:
        count = len(value) if isinstance(value, list) else value
        raise InputError(f"pose line: markers_m: expected {links} places, tail to head, found {count!r}")
    out = np.full((links, 2), np.nan)
    for k, point in enumerate(value):
        if point is None:
            continue
        if not isinstance(point, list) or len(point) != 2 or not all(map(_is_number, point)):
            raise InputError(f"pose line: markers_m[{k}]: expected [x, y] or null, found {point!r}")
        out[k] = point
    return out


class Camera:
    """Turns a source's reports into sightings on the pilot's clock.

    A sender's stamps have their own origin. Reports only come late, never early, so the least difference
    between arrival and stamp is the origin's offset plus the least delay; the constant delay that is left is
    found from the robot's own motion (`planners.pilot.observer`).

    Parameters
    ----------
    source : PoseSource
    """

    def __init__(self, source: PoseSource) -> None:
        self.source = source
        self._offsets: deque[float] = deque(maxlen=OBSERVER.clock_stamps)
        self._waiting: list[Report] = []
        self.last_arrived_s = -math.inf

    def poll(self) -> None:
        """Take in what has come."""
        new = [r for r in self.source.poll() if self._is_seen(r)]
        if new:
            self._waiting += new
            self.last_arrived_s = new[-1].arrived_s

    def take(self) -> list[Sighting]:
        """Return the sightings since the last call, in the order of their times."""
        reports, self._waiting = self._waiting, []
        sightings = [Sighting(self._time_of(r), r.pose, r.markers_m) for r in reports]
        return sorted(sightings, key=lambda s: s.time_s)

    def _is_seen(self, report: Report) -> bool:
        """Two neighbouring links at the least are needed for a place and a direction."""
        return report.markers_m is None or int(np.isfinite(report.markers_m[:, 0]).sum()) >= 2

    def _time_of(self, report: Report) -> float:
        if report.stamp_s is None:
            return report.arrived_s
        self._offsets.append(report.arrived_s - report.stamp_s)
        return report.stamp_s + min(self._offsets)

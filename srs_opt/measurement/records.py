"""A measured data set as frozen values (layout: docs, "A measured data set").

Lengths in metres, times in seconds on the valve clock (0 = the valves' start),
angles in radians, pressure in kPa; links and segments count from the tail.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from srs_opt.measurement.spots import Spots
    from srs_opt.robot import Robot

Array = NDArray[np.float64]

TAIL_TO_HEAD, CENTRE_OF_MASS = "tail_to_head", "centre_of_mass"
MARKER_ORDERS = (TAIL_TO_HEAD, CENTRE_OF_MASS)
STARTS = ("rest", "moving")
KINDS = ("gait", "tow", "push", "step", "still")
CONDITIONS = ("lifted", "ground")
DIRECTIONS = ("tangential", "normal")


@dataclass(frozen=True)
class Schedule:
    """Valve switch times of a trial, periodic.

    Attributes
    ----------
    name : str
        File name without its ending.
    period_s : float
        Period of the pattern.
    intervals : tuple of (segment, on_s, off_s)
        Segment (from 1) bends left (S = +1) from ``on_s`` to ``off_s``, both in
        [0, period); ``off_s < on_s`` wraps. Outside its intervals S = -1; a segment without
        intervals stays vented, S = 0.
    """

    name: str
    period_s: float
    intervals: tuple[tuple[int, float, float], ...]

    def state(self, segment: int, time_s: Array) -> Array:
        """Return S (+1, -1, or 0 where it has no intervals) of `segment` at `time_s`."""
        phase = np.mod(np.asarray(time_s, dtype=float), self.period_s)
        on = np.zeros(phase.shape, dtype=bool)
        if all(number != segment for number, _, _ in self.intervals):
            return np.zeros(phase.shape)
        for number, start, stop in self.intervals:
            if number == segment:
                inside = (phase >= start) & (phase < stop)
                wrapped = (phase >= start) | (phase < stop)
                on |= inside if start <= stop else wrapped
        return np.where(on, 1.0, -1.0)


@dataclass(frozen=True, eq=False)
class Applied:
    """What the chambers were given over time, as recorded, in place of a gait.

    Attributes
    ----------
    time_s : ndarray, shape (K,)
        From 0; each row holds until the next one.
    state : ndarray, shape (K, N-1)
        S of every segment, -1 (right) to 1 (left); 0 is vented, between lies a share of the pressure.
    pressure_kpa : ndarray, shape (K,)
    """

    time_s: Array
    state: Array
    pressure_kpa: Array


@dataclass(frozen=True, eq=False)
class Trial:
    """One recorded run.

    Attributes
    ----------
    name, frequency_hz, pressure_kpa, offset, phase_lag_rad, heading_rad, duration_s
        Columns of trials.csv; what does not apply to the kind of trial is 0.
    time_s : ndarray, shape (T,)
        Time labels of the camera; the first sample is labelled 0.
    markers_m : ndarray, shape (T, M, 2), or None
        Marker positions, tail to head or in the order of `spots`; NaN where a marker was lost.
    centre_m : ndarray, shape (T, 2), or None
        Centre of mass, where the set records that alone.
    schedule : Schedule or None
        Switch times, where they are not the valve wave (13).
    applied : Applied or None
        What was applied, where it is neither.
    tether : bool
        Whether the air tubes were attached.
    floor : str or None
        Name of the floor.
    replicate_of : str or None
        Trial that this one repeats.
    kind : {"gait", "tow", "push", "step", "still"}
        What was done.
    spots : tuple of Spot or None
        Where the markers sit; None: one on every link's centre.
    moving : bool
        Whether the recording begins in mid-gait: then the valves started before the first label, long enough
        for the start not to matter any more, and where the robot was and the clock's offset are to be fitted.
    """

    name: str
    frequency_hz: float
    pressure_kpa: float
    offset: float
    phase_lag_rad: float
    heading_rad: float
    duration_s: float
    time_s: Array
    markers_m: Array | None = None
    centre_m: Array | None = None
    schedule: Schedule | None = None
    applied: Applied | None = None
    tether: bool = True
    floor: str | None = None
    replicate_of: str | None = None
    kind: str = "gait"
    spots: Spots | None = None
    moving: bool = False

    @property
    def period_s(self) -> float:
        """Period of the gait (infinite when nothing repeats)."""
        if self.applied is not None:
            return float("inf")
        if self.schedule is not None:
            return self.schedule.period_s
        return 1 / self.frequency_hz if self.frequency_hz > 0 else float("inf")

    @property
    def lost_fraction(self) -> float:
        """Share of marker (or centre) samples without a position."""
        points = self.markers_m if self.markers_m is not None else self.centre_m
        return float(np.isnan(points[..., 0]).mean()) if points is not None and points.size else 1.0


@dataclass(frozen=True)
class MapRow:
    """One gait of maps.csv: means over replicates with sds; radius None when straight, + left."""

    frequency_hz: float
    pressure_kpa: float
    offset: float
    phase_lag_rad: float
    speed_m_s: float
    speed_sd_m_s: float
    radius_m: float | None
    radius_sd_m: float | None
    replicates: int


@dataclass(frozen=True, eq=False)
class StepTest:
    """One step response of one segment: curvature over time after S = 0 -> +1 (or -1)."""

    test: str
    segment: int | None
    condition: str
    pressure_kpa: float
    time_s: Array
    curvature_1_m: Array


@dataclass(frozen=True)
class SpringCarTest:
    """One pull of the spring car (Fig. 7): largest deflection before it moved."""

    direction: str
    spring_n_m: float
    car_mass_kg: float
    deflection_m: float


@dataclass(frozen=True)
class TowTest:
    """One tow of the straight, unpowered robot from its head at constant speed."""

    speed_m_s: float
    force_n: float
    with_tether: bool


@dataclass(frozen=True)
class Check:
    """A reading of another instrument."""

    quantity: str
    value: float
    sd: float


@dataclass(frozen=True)
class Bench:
    """All bench tests of a data set."""

    steps: tuple[StepTest, ...] = ()
    spring_car: tuple[SpringCarTest, ...] = ()
    tow: tuple[TowTest, ...] = ()
    checks: tuple[Check, ...] = ()


@dataclass(frozen=True, eq=False)
class DataSet:
    """A measured data set.

    Attributes
    ----------
    name : str
    robot : Robot
        The robot as documented; ``robot.relative_sd`` says how well its values are known.
    rate_hz, marker_sd_m : float
        Frame rate of the camera, standard deviation of a marker coordinate.
    markers : {"tail_to_head", "centre_of_mass"}
        What the tracks hold; other places of markers than the links' centres stand with the trials.
    trials : tuple of Trial
    maps : tuple of MapRow
    bench : Bench
    folder : Path or None
        Where it was read from.
    correlated_sd_m, correlation_s : float
        Of the camera's noise that is correlated in time (exponentially), beside the white one; 0 without.
    """

    name: str
    robot: Robot
    rate_hz: float
    marker_sd_m: float
    markers: str = TAIL_TO_HEAD
    trials: tuple[Trial, ...] = ()
    maps: tuple[MapRow, ...] = ()
    bench: Bench = field(default_factory=Bench)
    folder: Path | None = None
    correlated_sd_m: float = 0.0
    correlation_s: float = 0.0

    def trial(self, name: str) -> Trial:
        """Return the trial called `name`."""
        return next(t for t in self.trials if t.name == name)

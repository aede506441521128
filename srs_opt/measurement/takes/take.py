"""A recording of positions, whatever system made it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.records import Array

# metres per unit, by the names that exports use
UNITS = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 1.0),
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), 1e-3),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), 1e-2),
    **dict.fromkeys(("in", "inch", "inches"), 0.0254),
    **dict.fromkeys(("ft", "foot", "feet"), 0.3048),
}
SECONDS = {
    **dict.fromkeys(("s", "sec", "second", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "µs", "microsecond", "microseconds"), 1e-6),
    **dict.fromkeys(("min", "minutes"), 60.0),
}
WHOLE_RATE = 1e-3  # a rate found from rounded times is a whole number of Hz when it is this close to one
MOST_FILLED = 50  # frames on the clock per frame in the file


@dataclass(frozen=True, eq=False)
class Take:
    """A recording of positions.

    Attributes
    ----------
    source : Path
    name : str
        The take's name from the file, else the file's name.
    rate_hz : float
    time_s : ndarray, shape (T,)
        The take's own clock, in even steps; frames that were dropped are filled in without positions.
    markers, bodies : tuple of str
        Labels of the markers, and of the rigid bodies.
    marker_positions, body_positions : ndarray, shape (T, P, 3)
        In the system's axes; NaN where nothing was seen.
    scale_m : float or None
        Metres per unit of the positions; None when the file does not tell.
    flat : bool
        Whether the system sees a plane only (then z = 0).
    pixels : bool
        Whether the positions are those of a picture, whose scale cannot be guessed.
    told : tuple of str
        What the reader had to guess or to leave out.
    """

    source: Path
    name: str
    rate_hz: float
    time_s: Array
    markers: tuple[str, ...]
    marker_positions: Array
    bodies: tuple[str, ...] = ()
    body_positions: Array | None = None
    scale_m: float | None = 1.0
    flat: bool = False
    pixels: bool = False
    told: tuple[str, ...] = ()


@dataclass(frozen=True)
class ReadSettings:
    """What a person says about files that do not say it themselves.

    Attributes
    ----------
    rate_hz : float or None
        Frames per second.
    scale_m : float or None
        Metres per unit of the positions (per pixel of a video); wins over what the file says.
    least_likelihood : float
        Positions that a pose estimator is less sure of are taken as lost.
    columns : dict
        Which column is what, for tables in a layout of one's own (``--columns``).
    """

    rate_hz: float | None = None
    scale_m: float | None = None
    least_likelihood: float = 0.6
    columns: dict[str, object] | None = None


@dataclass(frozen=True, eq=False)
class Frames:
    """Samples as the file has them: time or frame number (or both), and the line of each for messages."""

    time_s: Array | None
    number: Array | None
    lines: Sequence[int]


def even_clock(
    path: Path, frames: Frames, rate_hz: float | None, told: list[str]
) -> tuple[float, Array, np.ndarray]:
    """Return the rate, the even clock, and the place of every sample on it.

    Frame numbers tell which frames were dropped; without them the times do.

    Raises
    ------
    InputError
        If the clock does not run forward, or neither clock nor rate is known.
    """
    time, number = frames.time_s, frames.number
    count = len(frames.lines)
    if count < 2:
        raise InputError(f"{path}: holds {count} frame(s), expected more")
    for values, what in ((number, "the frame number"), (time, "time")):
        if values is None:
            continue
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise InputError(f"{path}:{frames.lines[int(bad[0])]}: {what} is missing")
        bad = np.flatnonzero(np.diff(values) <= 0)
        if bad.size:
            raise InputError(f"{path}:{frames.lines[int(bad[0]) + 1]}: {what} does not increase")
    if number is not None and time is not None and rate_hz is not None:
        # both count: frame numbers of an export at a lower rate may go in steps
        drift = np.abs((time - time[0]) * rate_hz - (number - number[0]))
        if drift.max() > 0.5 + 1e-3 * (number[-1] - number[0]):
            number = None
    if time is None:
        if rate_hz is None:
            raise InputError(f"{path}: does not tell the frame rate; give it with --rate HZ")
        places = np.arange(count) if number is None else np.rint(number - number[0]).astype(int)
        first = 0.0 if number is None else float(number[0]) / rate_hz
    else:
        rate_hz = rate_hz or _rate_of(time, number, told)
        steps = number - number[0] if number is not None else (time - time[0]) * rate_hz
        if steps[-1] > MOST_FILLED * count:
            raise InputError(f"{path}: the clock jumps by {np.diff(time).max():.4g} s between two frames")
        places, first = np.rint(steps).astype(int), float(time[0])
        if (np.diff(places) <= 0).any():
            line = frames.lines[int(np.flatnonzero(np.diff(places) <= 0)[0]) + 1]
            raise InputError(f"{path}:{line}: frames lie closer than 1/{rate_hz:g} s (is the rate right?)")
    if places[-1] > MOST_FILLED * count:
        raise InputError(f"{path}: frame numbers jump by {np.diff(places).max()} between two rows")
    dropped = int(places[-1]) + 1 - count
    if dropped:
        told.append(f"{dropped} frames were dropped by the recording; they count as lost")
    return rate_hz, first + np.arange(int(places[-1]) + 1) / rate_hz, places


def _rate_of(time: Array, number: Array | None, told: list[str]) -> float:
    if number is not None:
        steps = number - number[0]
    else:
        steps = np.rint((time - time[0]) / np.median(np.diff(time)))
    slope = float(np.polyfit(steps, time - time[0], 1)[0])
    rate = 1 / slope
    if abs(rate - round(rate)) < WHOLE_RATE * rate and round(rate) > 0:
        rate = float(round(rate))
    told.append(f"the frame rate of {rate:.6g} Hz was found from the times")
    return rate


def on_clock(values: Array, places: np.ndarray, count: int) -> Array:
    """Return samples (T, ...) at their places on an even clock of `count` frames, NaN elsewhere."""
    out = np.full((count, *values.shape[1:]), np.nan)
    out[places] = values
    whole = np.isfinite(out).all(axis=-1, keepdims=True)
    return np.where(whole, out, np.nan)


def take_of(
    path: Path,
    frames: Frames,
    rate_hz: float | None,
    labels: Sequence[str],
    points: Array,
    told: Sequence[str],
    *,
    scale_m: float | None,
    name: str = "",
    bodies: Sequence[str] = (),
    body_points: Array | None = None,
    flat: bool = False,
    pixels: bool = False,
) -> Take:
    """Return the take of positions (T, P, 3) as the file has them, put on an even clock.

    Parameters
    ----------
    rate_hz : float or None
        What file or person say; else the times tell.
    told : sequence of str
        What the reader had to guess so far.

    Raises
    ------
    InputError
        As `even_clock`.
    """
    said = list(told)
    rate, time, places = even_clock(path, frames, rate_hz, said)
    if body_points is None:
        body_points = np.empty((len(points), 0, 3))
    return Take(
        source=path,
        name=name or path.stem,
        rate_hz=rate,
        time_s=time,
        markers=tuple(labels),
        marker_positions=on_clock(points, places, len(time)),
        bodies=tuple(bodies),
        body_positions=on_clock(body_points, places, len(time)),
        scale_m=scale_m,
        flat=flat,
        pixels=pixels,
        told=tuple(said),
    )


def unit_scale(path: Path, line: int, unit: str) -> float:
    """Return metres per unit.

    Raises
    ------
    InputError
        For an unknown unit.
    """
    scale = UNITS.get(unit.strip().lower())
    if scale is None:
        raise InputError(f"{path}:{line}: unknown length units '{unit[:40]}' (expected mm, cm, m, inches)")
    return scale

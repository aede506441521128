"""The page: a table of all trials, then one block per trial with its pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from srs_opt.figures import COLOURS, PAGE_IN, Picture, encoded, new_figure, styled
from srs_opt.files import write_text
from srs_opt.measurement.figures import bends_figure, track_figure
from srs_opt.measurement.motion import Interval
from srs_opt.measurement.records import DataSet
from srs_opt.problem import Problem
from srs_opt.report.seen import Seen
from srs_opt.robot import Robot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEAST_LOST = 0.001  # share of a trial's positions from which its losses get a picture


def write_page(
    dataset: DataSet, robot: Robot, found: Sequence[Seen], problems: Sequence[Problem], path: Path
) -> Path:
    """Write the page; pictures are part of it."""
    from importlib import resources

    from jinja2 import Environment

    text = resources.files("srs_opt.report").joinpath("page.html.jinja").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"mm": _millimetres, "interval": _interval}
    files = {f"trials/{s.trial.name}.csv" for s in found}
    page = environment.from_string(text).render(
        dataset=dataset,
        robot=robot,
        trials=[(seen, _pictures(seen)) for seen in found],
        notes=[p for p in problems if p.file not in files],
    )
    return write_text(path, page)


def _millimetres(value: float | None) -> str:
    return "–" if value is None else f"{1e3 * value:.2f}"


def _interval(interval: Interval | None, scale: float = 1.0) -> str:
    """Return a value with its 95 % interval."""
    if interval is None:
        return "–"
    if interval.low is None or interval.high is None:
        return f"{scale * interval.value:.4g}"
    ends = sorted((scale * interval.low, scale * interval.high))
    return f"{scale * interval.value:.4g} ({ends[0]:.4g} to {ends[1]:.4g})"


def _pictures(seen: Seen) -> list[Picture]:
    track = track_figure(seen.trial)
    drawn = [encoded(track, "Track", "Markers, and the robot every half second; the dot is the last marker.")]
    if seen.bends is not None:
        bends = bends_figure(seen.bends.seen, seen.bends.expected_1_m)
        words = "Curvatures of the first cycles from the markers, with 90 % bands"
        if seen.bends.expected_1_m is not None:
            words += ", and those that robot.yaml gives for these valve states"
        drawn.append(encoded(bends, "Bends", f"{words}."))
    if max(seen.lost) > LEAST_LOST:
        drawn.append(encoded(_lost_figure(seen), "Lost markers", "Frames without a position, per marker."))
    return drawn


@styled
def _lost_figure(seen: Seen) -> Figure:
    """Draw when each marker was lost."""
    points = seen.trial.markers_m if seen.trial.markers_m is not None else seen.trial.centre_m
    assert points is not None
    gone = np.isnan(points.reshape(len(points), -1, 2)[..., 0])
    count = gone.shape[1]
    figure, axes = new_figure(width_in=PAGE_IN, height_in=0.7 + 0.16 * count)
    for marker in range(count):
        times = seen.trial.time_s[gone[:, marker]]
        axes.plot(times, np.full(len(times), marker + 1), "|", color=COLOURS[1], markersize=5)
    axes.set(xlabel="time (s)", ylabel="marker", ylim=(0.4, count + 0.6))
    axes.set(xlim=(float(seen.trial.time_s[0]), float(seen.trial.time_s[-1])))
    axes.set_yticks(range(1, count + 1, max(1, count // 8)))
    return figure

"""Pictures of measurements: step fits (Fig. 6), circle fit (Fig. 10), shape over time, tracks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from srs_opt.figures import COLOURS, new_figure, styled
from srs_opt.measurement.circle import Circle
from srs_opt.measurement.records import Array, StepTest, Trial
from srs_opt.measurement.smooth import SmoothShape
from srs_opt.measurement.steps import StepFit
from srs_opt.model.actuator_law import step_response

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CONDITION = {"lifted": COLOURS[0], "ground": COLOURS[1]}
TRACK, FIT = COLOURS[1], COLOURS[0]
TRACK_IN = 2.7  # width of a track's axes
NARROWEST = 0.25  # of a track's axes, by the longer side: a straight track's scale stays legible


@styled
def step_figure(tests: Sequence[StepTest], fits: Sequence[StepFit]) -> Figure:
    """Draw step responses and their fits of (14), lifted and on the ground (paper, Fig. 6)."""
    figure, axes = new_figure(width_in=3.5, height_in=2.6)
    named: set[str] = set()
    for test, fit in zip(tests, fits):
        colour = CONDITION.get(test.condition, "black")
        axes.plot(test.time_s, test.curvature_1_m, ".", color=colour, markersize=2, alpha=0.5)
        fine = np.linspace(0.0, float(test.time_s[-1]), 300)
        s = (fit.tau1_s + fit.tau2_s) / 2
        q = ((fit.tau1_s - fit.tau2_s) / (2 * s)) ** 2
        label = None if test.condition in named else f"{test.condition}, (14) fitted"
        axes.plot(fine, fit.c0_1_m * step_response(fine - fit.delay_s, s, q), color=colour, label=label)
        named.add(test.condition)
    axes.set(xlabel="time (s)", ylabel="curvature (1/m)", title="step responses")
    axes.legend()
    return figure


@styled
def circle_figure(centre_track_m: Array, circle: Circle) -> Figure:
    """Draw a track of the centre of mass and the circle fitted to it (paper, Fig. 10)."""
    figure, axes = new_figure(width_in=3.5, height_in=3.5)
    angle = np.linspace(0, 2 * np.pi, 361)
    (x, y), radius = circle.centre_m, abs(circle.radius_m)
    axes.plot(centre_track_m[:, 0], centre_track_m[:, 1], ".", color=TRACK, markersize=2, label="track")
    label = f"circle, radius {radius:.4f} ± {circle.radius_sd_m:.4f} m"
    axes.plot(x + radius * np.cos(angle), y + radius * np.sin(angle), color=FIT, label=label)
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", title="trajectory and circle fit")
    axes.legend()
    return figure


@styled
def bends_figure(shape: SmoothShape, expected_1_m: Array | None = None, level_sds: float = 1.645) -> Figure:
    """Draw smoothed curvatures over time with their bands (90 % by default), and expected ones (T, N-1)."""
    segments = shape.curvature_1_m.shape[1]
    figure, grid = new_figure(segments, 1, height_in=0.8 + 0.9 * segments, sharex=True, squeeze=False)
    rows = grid[:, 0]
    for number, axes in enumerate(rows):
        middle, sd = shape.curvature_1_m[:, number], shape.curvature_sd_1_m[:, number]
        low, high = middle - level_sds * sd, middle + level_sds * sd
        axes.fill_between(shape.time_s, low, high, alpha=0.3, linewidth=0)
        axes.plot(shape.time_s, middle, label="seen")
        if expected_1_m is not None:
            axes.plot(
                shape.time_s, expected_1_m[:, number], color=COLOURS[1], linestyle="--", label="expected"
            )
        axes.set(ylabel=f"segment {number + 1}\n(1/m)")
    if expected_1_m is not None:
        rows[0].legend(loc="lower right", bbox_to_anchor=(1, 0.98), ncols=2, borderaxespad=0)
    rows[-1].set(xlabel="time (s)")
    return figure


@styled
def track_figure(trial: Trial, every_s: float = 0.5) -> Figure:
    """Draw a trial's markers and the robot's outline at intervals of `every_s`."""
    points = trial.markers_m if trial.markers_m is not None else trial.centre_m
    assert points is not None
    flat = points.reshape(-1, 2)
    low, high = np.nanmin(flat, axis=0), np.nanmax(flat, axis=0)
    wide, tall = np.maximum(high - low, NARROWEST * np.max(high - low)) * 1.1
    height_in = float(np.clip(TRACK_IN * tall / wide, 0, 2 * TRACK_IN)) + 0.8
    figure, axes = new_figure(width_in=TRACK_IN + 0.8, height_in=height_in)
    if trial.markers_m is not None:
        for number in range(trial.markers_m.shape[1]):
            axes.plot(*trial.markers_m[:, number].T, linewidth=0.5, color="0.7")
        for moment in np.arange(float(trial.time_s[0]), float(trial.time_s[-1]), every_s):
            frame = trial.markers_m[int(np.argmin(np.abs(trial.time_s - moment)))]
            seen = frame[np.isfinite(frame[:, 0])]
            axes.plot(*seen.T, "-", color=FIT, linewidth=1)
            axes.plot(*frame[-1], "o", color=TRACK, markersize=3)
    elif trial.centre_m is not None:
        axes.plot(*trial.centre_m.T, ".", markersize=2)
    middle = (low + high) / 2
    axes.set(
        xlim=(middle[0] - wide / 2, middle[0] + wide / 2), ylim=(middle[1] - tall / 2, middle[1] + tall / 2)
    )
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", title=f"trial {trial.name} (dot: head)")
    return figure

"""The report's pictures, as PNG in base64."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from srs_opt.calibrate.noise import track_of
from srs_opt.discrepancy.locate import misfit_by_trial
from srs_opt.discrepancy.seal import sealed_residuals
from srs_opt.discrepancy.words import with_what
from srs_opt.figures import COLOURS, PAGE_IN, Picture, encoded, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from srs_opt.discrepancy.describe import Description
    from srs_opt.discrepancy.pipeline import Discrepancy

WIDE = 8.0  # largest over smallest value from which on an axis is logarithmic
AFTER, BEFORE = COLOURS[:2]


@styled
def pictures(found: Discrepancy) -> list[Picture]:
    """Return the pictures that the result allows."""
    if found.null is None or found.best is None or found.shown_in is None or found.selection is None:
        return []
    drawn = [_candidates(found), _trials(found)]
    if found.description is not None and found.description.tried:
        drawn.insert(1, _terms(found.description))
    return [_sealed(found), *drawn] if found.split.sealed else drawn


def gap_picture(found: Discrepancy) -> Picture | None:
    """Return the picture that shows the gap close: the sealed trial that shows it most."""
    drawn = gap_figure(found)
    if drawn is None:
        return None
    return encoded(
        drawn,
        "The gap closes" if found.believed else "What the best explanation so far does to the gap",
        "A trial that no fit saw. Left: the body at its end, as measured and as predicted by both models "
        "(thin: the way of one marker). Right: root mean square distance per coordinate over a fifth "
        "of a second.",
    )


@styled
def gap_figure(found: Discrepancy) -> Figure | None:
    """Return the figure of the gap that closes, where an effect closes one on sealed trials."""
    if found.shown_in is None or found.null is None or found.selection is None or found.gap is None:
        return None
    trials = [t for t in found.split.sealed if t.name in found.gap.before.by_trial]
    if not trials or not found.selection.best.candidates:
        return None
    trial = max(trials, key=lambda t: found.gap.before.by_trial[t.name])  # type: ignore[union-attr]
    fits = [found.null.hypothesis.fit, found.selection.best.fit]
    residuals = [sealed_residuals(found.shown_in, f, [trial])[0] for f in fits]
    track = np.asarray(track_of(trial))
    figure = _figure(PAGE_IN, 2.9)
    room, course = figure.subplots(1, 2, width_ratios=(1.0, 1.2))
    last = int(np.flatnonzero(np.isfinite(track).all(axis=1))[-1]) if np.isfinite(track).all(1).any() else -1
    measured = track.reshape(len(track), -1, 2)
    for residual, label, colour in zip(residuals, _labels(found), (BEFORE, AFTER)):
        points = 1e3 * (track - residual).reshape(len(track), -1, 2)
        room.plot(*middle(points).T, color=colour, lw=0.8, alpha=0.6)
        room.plot(*points[last].T, "-", color=colour, lw=2.0)
        course.plot(trial.time_s, 1e3 * _rolling(residual), color=colour, label=label)
    room.plot(*(1e3 * measured[last]).T, "o", mfc="none", color="k", ms=4, label="measured")
    room.plot(*(1e3 * middle(measured)).T, color="k", lw=0.8, ls=":")
    room.set_aspect("equal", adjustable="datalim")
    room.set_xlabel("x (mm)")
    room.set_ylabel("y (mm)")
    course.axhline(1e3 * found.gap.noise_floor, color="k", lw=0.8, ls="--", label="noise floor")
    _spread(course)
    course.set_xlabel("time (s)")
    course.set_ylabel("distance to the markers (mm)")
    course.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    room.legend(loc="best")
    # neither the trial's name, which can be long, nor the body's title may reach the legend on the right
    figure.suptitle(f"trial {trial.name}")
    room.set_title(f"after {trial.time_s[last]:.1f} s", loc="left")
    return figure


def _spread(axis: Axes) -> None:
    """Make the axis of values logarithmic where they span much, with plain numbers where there is room."""
    from matplotlib.ticker import LogFormatter

    low, high = axis.dataLim.intervaly
    if not 0 < low * WIDE < high:
        return

    class Plain(LogFormatter):
        def __call__(self, x: float, pos: int | None = None) -> str:
            return f"{x:g}" if super().__call__(x, pos) else ""

    axis.set_yscale("log")
    axis.yaxis.set_major_formatter(Plain())
    axis.yaxis.set_minor_formatter(Plain())


def _labels(found: Discrepancy) -> tuple[str, str]:
    """Return what the two models of a picture are called."""
    return "calibration alone", with_what(found)


def middle(points: np.ndarray) -> np.ndarray:
    """Return the way (T, 2) of the marker that was seen most, of several the nearest to the body's middle.

    The mean of the seen markers would jump whenever one is lost.
    """
    seen = np.isfinite(points[..., 0]).sum(axis=0)
    away = np.abs(np.arange(seen.size) - (seen.size - 1) / 2)
    return np.asarray(points[:, np.lexsort((away, -seen))[0]])


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=150, layout="constrained")
    return figure


def _sealed(found: Discrepancy) -> Picture:
    """Draw the smoothed residual over time on the sealed trials, before and after."""
    assert found.shown_in is not None and found.null is not None and found.selection is not None
    trials = sorted(found.split.sealed[:4], key=lambda trial: trial.name)
    fits = [found.null.hypothesis.fit, found.selection.best.fit]
    figure = _figure(PAGE_IN, 0.9 + 1.2 * len(trials))
    axes = figure.subplots(len(trials), 1, sharex=True, squeeze=False)[:, 0]
    labels, colours = _labels(found), (BEFORE, AFTER)
    shown = 2 if found.selection.best.candidates else 1
    for fit, label, colour in list(zip(fits, labels, colours))[:shown]:
        for axis, trial, residual in zip(axes, trials, sealed_residuals(found.shown_in, fit, trials)):
            axis.plot(trial.time_s, 1e3 * _rolling(residual), color=colour, label=label, lw=1.3)
            axis.set_ylabel(f"{trial.name}\n(mm)")
    for axis in axes:
        axis.axhline(1e3 * found.sd_m, color="k", lw=0.8, ls="--", label="noise floor")
        axis.set_ylim(bottom=0)
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
    axes[-1].set_xlabel("time (s)")
    return encoded(
        figure,
        "The gap on sealed trials",
        "Distance between model and markers (root mean square per coordinate over a fifth of a second), each "
        "trial with its own most probable friction and curvature within the scatter.",
    )


def _rolling(residual: np.ndarray, width: int = 24) -> np.ndarray:
    """Return the root mean square over all coordinates in a running window of frames."""
    square = np.nan_to_num(residual) ** 2
    kernel = np.ones(min(width, residual.shape[0]))
    total = np.convolve(square.sum(axis=1), kernel, mode="same")
    count = np.convolve(np.isfinite(residual).sum(axis=1), kernel, mode="same")
    return np.asarray(np.sqrt(total / np.maximum(count, 1)))


def _candidates(found: Discrepancy) -> Picture:
    """Draw every effect's expected gain on a log axis."""
    assert found.null is not None
    best: dict[str, float] = {}
    for score in found.scores:
        gain = score.improvement * found.null.linearisation.variance_inflation
        best.setdefault(score.candidate.effect, max(gain, 0.0))
    names = list(best)[::-1]
    figure = _figure(PAGE_IN, 0.5 + 0.17 * len(names))
    axis = figure.subplots()
    chosen = found.selection.best.names if found.selection else ()
    axis.barh(names, [best[n] + 0.1 for n in names], color=[AFTER if n in chosen else "0.7" for n in names])
    axis.axvline(20, color="k", ls="--", lw=0.8)
    axis.set_xscale("log")
    axis.set_xlabel("expected gain (drop of the deviance); dashed: about what chance gives the best of all")
    return encoded(
        figure,
        "What each effect would explain",
        "From one linearisation about the calibrated model, without refitting; blue: in the best set.",
    )


def _terms(description: Description) -> Picture:
    """Draw what every term of the grammar that was fitted leaves of the misfit."""
    tried = description.tried[::-1]
    figure = _figure(PAGE_IN, 0.7 + 0.2 * len(tried))
    axis = figure.subplots()
    left = [max(h.fit.misfit_ratio - 1, 1e-3) for h in tried]
    colours = [AFTER if h.label == description.best.label else "0.7" for h in tried]
    axis.barh([h.label.removeprefix("generic_") for h in tried], left, color=colours)
    axis.set_xscale("log")
    axis.set_xlabel("misfit that is left / noise variance")
    return encoded(
        figure,
        "What each term of the grammar leaves",
        "Those that were fitted, to the start of a few trials; blue: the best. Place in brackets.",
    )


def _trials(found: Discrepancy) -> Picture:
    """Draw the misfit of every open trial, before and after."""
    assert found.null is not None and found.best is not None
    before, after = misfit_by_trial(found.null), misfit_by_trial(found.best)
    names = [t.name for t in found.split.open]
    place = np.arange(len(names))
    figure = _figure(PAGE_IN, 2.4)
    axis = figure.subplots()
    alone, added = _labels(found)
    axis.plot(place, [before[n] for n in names], "o", color=BEFORE, label=alone)
    if found.best.hypothesis.candidates:
        axis.plot(place, [after[n] for n in names], "s", mfc="none", color=AFTER, label=added)
    axis.axhline(1, color="k", ls="--", lw=0.8)
    axis.set_xticks(place, names, rotation=60)
    axis.set_ylabel("misfit / noise variance")
    _spread(axis)
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return encoded(figure, "Every open trial", "1 is what noise alone leaves.")

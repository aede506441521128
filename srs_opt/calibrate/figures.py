"""Picture of a calibration: how far every value lies from its bench value."""

from __future__ import annotations

from typing import TYPE_CHECKING

from srs_opt.figures import COLOURS, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from srs_opt.calibrate.result import Calibration


@styled
def bench_figure(found: Calibration, most: float) -> Figure:
    """Return a bar per value: its distance from the bench value, in deviations of the bench.

    Bars beyond `most` deviations are marked.
    """
    names = list(found.off_bench)
    figure, axes = new_figure(width_in=4.8, height_in=0.9 + 0.25 * max(len(names), 1))
    off = list(found.off_bench.values())
    axes.barh(names, off, color=[COLOURS[1] if abs(v) > most else COLOURS[0] for v in off])
    for limit in (-most, most):
        axes.axvline(limit, color="black", linewidth=0.8, linestyle="--")
    axes.set_xlabel("distance from the bench value (standard deviations of the bench)")
    axes.invert_yaxis()
    return figure

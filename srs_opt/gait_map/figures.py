"""Contour maps of speed and radius over frequency and pressure, like the paper's Figs. 8 and 9."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from srs_opt.figures import PAGE_IN, SEQUENTIAL, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    from srs_opt.gait_map.grid import GaitMap

_MOST_PANELS = 5
_LEVELS = 12
# largest over smallest radius beyond which levels are equally spaced in the logarithm: otherwise a wide turn
# would take all levels, and the tight ones, which matter in a maze, none
_WIDE = 3.0


@styled
def map_figures(gaits: GaitMap) -> dict[str, Figure]:
    """Return a sheet per phase lag, by name: speed above, radius below, a column per offset."""
    sheets: dict[str, Figure] = {}
    lags = np.unique(gaits.column("phase_lag_rad"))
    for lag in lags:
        at_lag = gaits.rows[gaits.column("phase_lag_rad") == lag]
        sheet = replace(gaits, rows=at_lag)
        if min(np.unique(sheet.column(c)).size for c in ("frequency_hz", "pressure_kpa")) < 2:
            continue
        name = "map" if lags.size == 1 else f"map_lag{lag:.2f}"
        sheets[name] = _sheet(sheet, lag)
    return sheets


def _sheet(gaits: GaitMap, lag: float) -> Figure:
    offsets = np.unique(gaits.column("offset"))
    shown = offsets[np.linspace(0, offsets.size - 1, min(offsets.size, _MOST_PANELS)).round().astype(int)]
    turning = bool(np.isfinite(gaits.column("radius_m")).any())
    rows = 2 if turning else 1
    figure, axes = new_figure(
        rows,
        shown.size,
        width_in=min(PAGE_IN, 1.2 + 2.3 * shown.size),
        height_in=0.5 + 2.0 * rows,
        squeeze=False,
    )
    for column, offset in enumerate(shown):
        part = replace(gaits, rows=gaits.rows[gaits.column("offset") == offset])
        _contours(axes[0, column], part, np.abs(part.column("speed_m_s")), "speed (m/s)")
        axes[0, column].set_title(f"offset {offset:g}, lag {lag:.2f} rad")
        if turning:
            radius = np.abs(part.column("radius_m"))
            _contours(axes[1, column], part, radius, "radius (m)")
    return figure


def _contours(axes: Axes, part: GaitMap, values: np.ndarray, label: str) -> None:
    frequency, pressure = np.unique(part.column("frequency_hz")), np.unique(part.column("pressure_kpa"))
    table = np.full((pressure.size, frequency.size), np.nan)
    rows = np.searchsorted(pressure, part.column("pressure_kpa"))
    table[rows, np.searchsorted(frequency, part.column("frequency_hz"))] = values
    if not np.isfinite(table).any():
        axes.text(0.5, 0.5, "straight:\nno radius", transform=axes.transAxes, ha="center")
        axes.set_axis_off()
        return
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel("pressure (kPa)")
    levels, norm = _levels(table) if label.startswith("radius") else (_LEVELS, None)
    filled = axes.contourf(frequency, pressure, table, levels, cmap=SEQUENTIAL, norm=norm)
    shown = np.asarray(filled.levels)[::2]
    lines = axes.contour(frequency, pressure, table, shown, colors="white", linewidths=0.5)
    bar = axes.figure.colorbar(filled, ax=axes, label=label, ticks=shown, format="%.3g")
    bar.add_lines(lines)  # labels within the map would be cut off at its edges


def _levels(table: np.ndarray) -> tuple[Any, Normalize | None]:
    """Return what `contourf` takes for its levels and its norm."""
    from matplotlib.colors import LogNorm

    least, most = float(np.nanmin(table)), float(np.nanmax(table))
    if not most > _WIDE * least > 0:
        return _LEVELS, None
    return np.geomspace(least, most, _LEVELS), LogNorm(least, most)

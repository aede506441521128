"""Pictures: the convergence of a search, the Pareto front of a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from srs_opt.figures import COLOURS, SEQUENTIAL, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from srs_opt.gait_opt.search import Found
    from srs_opt.gait_opt.table import GaitTable

_MM = 1e3


@styled
def convergence_figure(found: Found) -> Figure:
    """Show the winning start's continuation in the friction, collocation beside simulation."""
    figure, (top, bottom) = new_figure(2, 1, width_in=4.6, height_in=4.0, sharex=True)
    steps = found.steps
    number = np.arange(1, len(steps) + 1)
    top.plot(number, [s.speed_m_s for s in steps], "o-", color=COLOURS[0], markersize=4, label="collocation")
    simulated = [s.simulated_m_s for s in steps]
    top.plot(number, simulated, "x--", color=COLOURS[1], markersize=5, label="simulated")
    top.set(ylabel="speed (m/s)")
    top.legend()
    bottom.semilogy(
        number, [max(s.relative_error, 1e-6) for s in steps], "s-", color=COLOURS[2], markersize=4
    )
    bottom.axhline(0.005, color="black", linewidth=0.8, linestyle="--")
    bottom.set(ylabel="relative error", xlabel="smoothing speed of friction (mm/s), elements")
    bottom.set_xticks(number, [f"{_MM * s.stage.friction_speed_m_s:g}\n{s.elements}" for s in steps])
    return figure


@styled
def pareto_figure(table: GaitTable) -> Figure:
    """Show speed against the path's curvature, forward gaits coloured by the width of their swept band."""
    figure, axes = new_figure(width_in=4.8, height_in=3.2)
    forward = [g for g in table.gaits if g.speed_m_s > 0]
    bend = [0.0 if g.radius_m is None else 1 / g.radius_m for g in forward]
    bands = [_MM * sum(g.envelope_m) for g in forward]
    points = axes.scatter(bend, [g.speed_m_s for g in forward], c=bands, cmap=SEQUENTIAL, s=16)
    figure.colorbar(points, label="swept band (mm)")
    axes.set(xlabel="bend of the path, 1/radius (1/m), + left", ylabel="speed (m/s)")
    axes.set_ylim(bottom=0)
    return figure

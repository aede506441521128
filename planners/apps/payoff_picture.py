"""Plans before and after a correction, and what the corrected robot makes of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import shapely

from planners.apps.payoff import MazePayoff, PlanRun
from planners.maze.draw import draw_maze
from srs_opt.figures import COLOURS, PAGE_IN, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PLANNED, OPEN_LOOP, DRIVEN = "#202020", COLOURS[1], COLOURS[0]
BODIES = 40  # of the open-loop run, whose union is drawn


@styled
def payoff_figure(payoff: MazePayoff) -> Figure:
    """Return the picture: the calibrated robot's plan on the left, the corrected one's on the right."""
    from matplotlib.figure import Figure

    ratio = payoff.maze.height_m / payoff.maze.width_m
    height = min(max(0.5 * PAGE_IN * ratio, 1.4), 8) + 0.9
    figure = Figure(figsize=(PAGE_IN, height), dpi=150, layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    sides = (("calibrated", payoff.before), ("corrected", payoff.after))
    for axes, (which, run) in zip(panels, sides):
        draw_maze(axes, payoff.maze)
        if run is None:
            axes.set_title(f"{which} robot: no way found", fontsize=9)
            continue
        axes.set_title(f"planned with the {which} robot", fontsize=9)
        _draw(axes, run)
    shown = next((axes for axes, (_, run) in zip(panels, sides) if run is not None), None)
    if shown is not None:
        figure.legend(*shown.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    return figure


def _draw(axes: Axes, run: PlanRun) -> None:
    open_loop, body = run.open_loop, run.problem.body
    step = max(1, len(open_loop.time_s) // BODIES)
    bodies = shapely.buffer(shapely.linestrings(open_loop.lines[::step]), body.half_width_m, quad_segs=6)
    for part in shapely.get_parts(shapely.union_all(bodies)):
        axes.fill(*part.exterior.xy, color=OPEN_LOOP, alpha=0.18, linewidth=0, zorder=1)
    ways = (
        (run.plan.certificate.pose, "-", PLANNED, "planned"),
        (open_loop.pose, "-", OPEN_LOOP, "open loop"),
        (run.driven.pose, "--", DRIVEN, "driven with feedback"),
    )
    for pose, line, color, label in ways:
        axes.plot(pose[:, 0], pose[:, 1], line, color=color, linewidth=1.1, zorder=4, label=label)

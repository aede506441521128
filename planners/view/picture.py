"""The maze with the swept body coloured and numbered by gait, and the clearance along the way."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from planners.maze.draw import draw_maze
from planners.plan.answer import Plan
from planners.plan.certify import clearances
from planners.search.problem import Problem
from planners.view.settings import VIEW
from srs_opt.figures import PAGE_IN, RIGHT, SEQUENTIAL, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from planners.drive.execute import Execution

PATH, DRIVEN = "#202020", RIGHT


@styled
def plan_figure(problem: Problem, plan: Plan, driven: Execution | None = None) -> Figure:
    """Return the picture of a plan: maze with swept body above, clearance below.

    Gaits are coloured, and numbered on the path, in the order in which the plan comes to them.

    Parameters
    ----------
    problem : Problem
    plan : Plan
    driven : Execution, optional
        How it was driven.
    """
    from matplotlib.figure import Figure

    ratio = problem.maze.height_m / problem.maze.width_m
    height = min(max(0.75 * PAGE_IN * ratio, 1.6), 8) + 1.8
    figure = Figure(figsize=(PAGE_IN, height), layout="constrained")
    above, below = figure.subplots(2, 1, height_ratios=(max(4 * ratio, 1.4), 1))
    draw_maze(above, problem.maze)
    colors = draw_swept(above, problem, plan)
    c = plan.certificate
    above.plot(c.pose[:, 0], c.pose[:, 1], color=PATH, linewidth=0.8, zorder=4, label="centre of mass")
    if driven is not None:
        above.plot(*driven.pose[:, :2].T, "--", color=DRIVEN, linewidth=1, zorder=5, label="driven")
    figure.legend(
        loc="outside right upper",
        title=f"{problem.maze.name}: {plan.duration_s:.1f} s, {plan.length_m:.2f} m",
        title_fontsize=8,
    )
    draw_clearance(below, problem, plan, colors)
    if driven is not None:
        _draw_driven_clearance(below, problem, driven)
    return figure


def gait_colors(gaits: Iterable[int]) -> dict[int, Any]:
    """Return a colour for every gait used, dark to light in the order of their first use."""
    import matplotlib

    order = list(dict.fromkeys(gaits))
    shades = np.linspace(0.0, 0.95, max(len(order), 2))
    palette = matplotlib.colormaps[SEQUENTIAL]
    return {gait: palette(shade) for gait, shade in zip(order, shades)}


def draw_swept(axes: Axes, problem: Problem, plan: Plan) -> dict[int, Any]:
    """Fill the region that the body sweeps, coloured and numbered by gait; return the colours."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    played = problem.motion.rows(plan.gaits)
    colors = gait_colors(played)
    number = {gait: k for k, gait in enumerate(colors, start=1)}
    c = plan.certificate
    labelled: set[int] = set()
    first = 0
    for gait, run in groupby(played):
        count = len(list(run))
        inside = (c.cycle >= first) & (c.cycle < first + count)
        first += count
        instants = _thinned(c.time_s, np.flatnonzero(inside))
        if not instants.size:
            continue
        bodies = shapely.buffer(
            shapely.linestrings(c.lines[instants]), problem.body.half_width_m, quad_segs=6
        )
        region = shapely.union_all(bodies)
        rings = [
            Outline(np.asarray(ring.coords), closed=True)
            for part in shapely.get_parts(region)
            for ring in (part.exterior, *part.interiors)
        ]
        label = None if gait in labelled else f"{number[gait]}  {problem.gaits.gaits[gait].name}"
        labelled.add(gait)
        _number(axes, c.pose[inside, :2], number[gait], VIEW.least_labelled * problem.robot.length_m)
        axes.add_patch(
            PathPatch(
                Outline.make_compound_path(*rings),
                facecolor=colors[gait],
                alpha=0.55,
                linewidth=0,
                label=label,
                zorder=1,
            )
        )
    return colors


def draw_clearance(axes: Axes, problem: Problem, plan: Plan, colors: dict[int, Any]) -> None:
    """Draw the body's clearance over time, coloured by gait, with the margin."""
    c = plan.certificate
    # the certificate stops at a lower bound where that is enough: it would draw steps that are none
    room = 1e3 * clearances(problem, c.lines, VIEW.shown_clearance_m).clip(max=VIEW.shown_clearance_m)
    first = 0
    for gait, run in groupby(problem.motion.rows(plan.gaits)):
        count = len(list(run))
        inside = (c.cycle >= first) & (c.cycle < first + count)
        first += count
        axes.plot(c.time_s[inside], room[inside], color=colors[gait], linewidth=1.2)
    axes.axhline(1e3 * problem.margin_m, color=PATH, linewidth=0.8, linestyle=":")
    axes.set_ylim(bottom=0)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("clearance (mm)")
    axes.set_title("clearance of the body, cut off at 100 mm; dotted: margin", fontsize=8)


def _draw_driven_clearance(axes: Axes, problem: Problem, driven: Execution) -> None:
    room = 1e3 * clearances(problem, driven.lines, VIEW.shown_clearance_m).clip(max=VIEW.shown_clearance_m)
    axes.plot(driven.time_s, room, "--", color=DRIVEN, linewidth=1)
    axes.set_title("clearance of the body, cut off at 100 mm; dashed: driven, dotted: margin", fontsize=8)


def _number(axes: Axes, way: NDArray[Any], number: int, least_m: float) -> None:
    """Write a gait's number beside the middle of the way (n, 2) that it takes, if there is room."""
    from matplotlib.patheffects import withStroke

    if np.hypot(*np.diff(way, axis=0).T).sum() < least_m:
        return
    x, y = way[len(way) // 2]
    axes.text(
        float(x), float(y), str(number), fontsize=6, ha="center", va="center", zorder=6,
        path_effects=[withStroke(linewidth=2, foreground="white")],
    )  # fmt: skip


def _thinned(time_s: NDArray[Any], instants: NDArray[Any]) -> NDArray[Any]:
    """Return instants about `VIEW.body_step_s` apart."""
    if not instants.size:
        return instants
    wanted = np.arange(time_s[instants[0]], time_s[instants[-1]] + VIEW.body_step_s, VIEW.body_step_s)
    near = np.searchsorted(time_s[instants], wanted).clip(0, instants.size - 1)
    chosen: NDArray[Any] = instants[np.unique(near)]
    return chosen

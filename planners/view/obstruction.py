"""The picture of why there is no way: the widest route and its tightest place."""

from __future__ import annotations

from typing import TYPE_CHECKING

from planners.maze.draw import draw_maze
from planners.plan.explain import Explanation
from planners.search.problem import Problem
from srs_opt.figures import PAGE_IN, RIGHT, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARK = RIGHT


@styled
def obstruction_figure(problem: Problem, explanation: Explanation) -> Figure:
    """Return the picture: maze, widest route, a ring about its tightest place, a close-up."""
    from matplotlib.patches import Circle

    place = explanation.tightest
    if place is None:
        figure, whole = new_figure(width_in=PAGE_IN, height_in=2.8)
        draw_maze(whole, problem.maze)
        whole.set_title("start and goal are not connected")
    else:
        ratio = problem.maze.width_m / problem.maze.height_m
        figure, (whole, close) = new_figure(
            1, 2, width_in=PAGE_IN, height_in=2.8, width_ratios=(min(max(ratio, 1.0), 3.0), 1)
        )
        for axes in (whole, close):
            draw_maze(axes, problem.maze)
        reach = max(3 * place.width_m, 0.5 * problem.robot.length_m)
        for axes in (whole, close):
            axes.plot(*place.route.T, color=MARK, linewidth=0.8, zorder=3)
        whole.add_patch(
            Circle((place.x_m, place.y_m), reach, fill=False, color=MARK, linewidth=1.5, zorder=4)
        )
        for width, style in ((place.width_m, "-"), (explanation.needs[0][1], "--")):
            ring = Circle(
                (place.x_m, place.y_m), width / 2, fill=False, color=MARK, linestyle=style, zorder=4
            )
            close.add_patch(ring)
        close.set_xlim(place.x_m - reach, place.x_m + reach)
        close.set_ylim(place.y_m - reach, place.y_m + reach)
        whole.set_title(f"tightest place: {1e3 * place.width_m:.0f} mm")
        name, width = explanation.needs[0]
        close.set_title(f"dashed: {name}\nneeds {1e3 * width:.0f} mm")
    return figure

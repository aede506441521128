"""The picture of why there is no way: the widest route and its tightest place."""

from __future__ import annotations

from pathlib import Path

from planners.maze.draw import draw_maze
from planners.plan.explain import Explanation
from planners.search.problem import Problem
from srs_opt.figures import styled
from srs_opt.files import atomic_path

MARK = "#c0392b"


@styled
def save_obstruction_picture(path: Path, problem: Problem, explanation: Explanation) -> Path:
    """Write the picture (PNG): the maze, the widest route, a ring about the tightest place, a close-up."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    figure = Figure(figsize=(10, 4.5), layout="constrained")
    whole, close = figure.subplots(1, 2, width_ratios=(2, 1))
    for axes in (whole, close):
        draw_maze(axes, problem.maze)
    place = explanation.tightest
    if place is None:
        whole.set_title("start and goal are not connected", fontsize=9)
        close.set_visible(False)
    else:
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
        whole.set_title(f"tightest place: {1e3 * place.width_m:.0f} mm", fontsize=9)
        name, width = explanation.needs[0]
        close.set_title(f"dashed: {name} needs {1e3 * width:.0f} mm", fontsize=9)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=130)
    return path

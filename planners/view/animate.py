"""The robot on its way through the maze, as a GIF or (with ffmpeg) an MP4."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from planners.maze.draw import draw_maze
from planners.plan.answer import Plan
from planners.search.problem import Problem
from planners.view.animation_path import check_animation_path
from planners.view.picture import gait_colors
from planners.view.settings import VIEW
from srs_opt.figures import plain_names
from srs_opt.files import atomic_path

if TYPE_CHECKING:
    from planners.drive.execute import Execution

LONG_SIDE_INCHES = 7.0


def save_animation(path: Path, problem: Problem, plan: Plan, execution: Execution | None = None) -> Path:
    """Write the animation of a plan, or of its execution where there is one; real time, thinned when long.

    Raises
    ------
    InputError
        For an unknown ending, or .mp4 without ffmpeg.
    """
    from matplotlib.animation import FFMpegWriter, FuncAnimation
    from matplotlib.figure import Figure
    from matplotlib.patches import Polygon

    check_animation_path(path)
    time, pose, lines, gait = _motion(plan, problem, execution)
    frames = min(VIEW.most_frames, max(2, int(time[-1] * VIEW.frames_per_s)))
    index = np.searchsorted(time, np.linspace(0, time[-1], frames)).clip(0, len(time) - 1)
    ratio = problem.maze.height_m / problem.maze.width_m
    size = (LONG_SIDE_INCHES, LONG_SIDE_INCHES * ratio) if ratio < 1 else (LONG_SIDE_INCHES / ratio, 7.0)
    figure = Figure(figsize=(max(size[0], 2.5), max(size[1], 2.0) + 0.3), dpi=90, layout="constrained")
    axes = figure.subplots()
    draw_maze(axes, problem.maze)
    axes.set_xlabel("")
    axes.set_ylabel("")
    colors = gait_colors(problem.motion.rows((*plan.gaits, *(execution.gaits if execution else ()))))
    body = Polygon(np.zeros((3, 2)), closed=True, edgecolor="#202020", linewidth=0.6, zorder=5)
    axes.add_patch(body)
    (trail,) = axes.plot([], [], color="#202020", linewidth=0.8, zorder=4)
    (head,) = axes.plot([], [], "o", color="white", markeredgecolor="#202020", markersize=3.5, zorder=6)
    title = axes.set_title("", fontsize=9)

    def draw(frame: int) -> tuple[Any, ...]:
        k = index[frame]
        outline = shapely.LineString(lines[k]).buffer(problem.body.half_width_m, quad_segs=6)
        body.set_xy(np.asarray(outline.exterior.coords))
        body.set_facecolor(colors[int(gait[k])])
        head.set_data(lines[k, -1:, 0], lines[k, -1:, 1])
        trail.set_data(pose[: k + 1, 0], pose[: k + 1, 1])
        title.set_text(f"{time[k]:5.1f} s   {problem.gaits.gaits[int(gait[k])].name}")
        return body, trail, head, title

    rate = frames / max(time[-1], 1e-3)
    held = [*range(frames), *[frames - 1] * round(VIEW.hold_s * rate)]  # at the end, before it begins anew
    plain_names(figure)
    draw(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # laid out once: half of what every frame would take
    animation = FuncAnimation(figure, draw, frames=held, interval=1000 / VIEW.frames_per_s)
    movie = path.suffix.lower() == ".mp4"
    with atomic_path(path) as temporary:
        animation.save(str(temporary), writer=(FFMpegWriter if movie else _gif_writer())(fps=max(rate, 1)))
    return path


def _gif_writer() -> Any:
    """Return matplotlib's writer of GIFs, which without a frame (Ctrl-C) has nothing to finish."""
    from matplotlib.animation import PillowWriter

    class Writer(PillowWriter):
        def finish(self) -> None:
            if self._frames:  # type: ignore[attr-defined]
                super().finish()

    return Writer


def _motion(plan: Plan, problem: Problem, execution: Execution | None) -> tuple[Any, Any, Any, Any]:
    """Return times, poses, centre lines and gait indices."""
    rows = problem.motion.rows
    if execution is None:
        c = plan.certificate
        return c.time_s, c.pose, c.lines, np.array(rows(plan.gaits))[c.cycle]
    ends = np.cumsum(problem.motion.periods(execution.gaits))
    cycle = np.searchsorted(ends, execution.time_s).clip(0, len(execution.gaits) - 1)
    return execution.time_s, execution.pose, execution.lines, np.array(rows(execution.gaits))[cycle]

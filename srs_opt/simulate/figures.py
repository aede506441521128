"""Picture of a simulated trial: the path with the body, and the curvatures behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from srs_opt.figures import COLOURS, PAGE_IN, draw_body, new_figure, styled
from srs_opt.geometry import rotate
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.shapes import centre_lines

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from srs_opt.simulate.run import Simulation


@styled
def simulation_figure(result: Simulation) -> Figure:
    """Return the picture of path, body and curvatures."""
    robot, path = result.robot, result.trajectory
    figure, (room, bend) = new_figure(
        1, 2, width_in=PAGE_IN, height_in=2.8, gridspec_kw={"width_ratios": [1.3, 1]}
    )
    room.plot(path.pose[:, 0], path.pose[:, 1], color=COLOURS[6], linewidth=0.8, label="centre of mass")
    run = Integrator(robot, result.model)
    shown = np.linspace(0, _until(result), 7)
    pose, kappa = path.at(shown)
    x, y = centre_lines(run, kappa).T
    x, y = rotate(pose[:, 2], x, y)
    for k in range(shown.size):
        shade = 0.25 + 0.6 * k / (shown.size - 1)
        draw_body(
            room,
            x[:, k] + pose[k, 0],
            y[:, k] + pose[k, 1],
            robot.body_width_m,
            color=COLOURS[0],
            alpha=shade,
        )
    room.set_aspect("equal", adjustable="datalim")
    room.set_xlabel("x (m)")
    room.set_ylabel("y (m)")
    room.set_title("centre of mass (line) and body")
    shown_s = path.time_s[-1] if result.gait is None else 3 * result.gait.period_s
    last = path.time_s >= path.time_s[-1] - shown_s
    for i in range(robot.segments):
        colour = COLOURS[i % len(COLOURS)]
        bend.plot(path.time_s[last], path.kappa[last, i], color=colour, label=f"segment {i + 1}")
    bend.set_xlabel("time (s)")
    bend.set_ylabel("curvature (1/m), + left")
    if robot.segments <= 8:
        bend.legend(ncols=2, loc="upper center", bbox_to_anchor=(0.5, 1.22))
    return figure


def _until(result: Simulation) -> float:
    """Return the time up to which bodies are drawn: less than one turn, so that they do not overlap."""
    turned = np.abs(result.trajectory.pose[:, 2] - result.trajectory.pose[0, 2])
    late = np.flatnonzero(turned > 0.85 * 2 * np.pi)
    return float(result.trajectory.time_s[late[0] if late.size else -1])

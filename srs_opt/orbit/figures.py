"""Picture of a steady gait: body, valves, curvatures, speeds, swept band and work over a cycle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from srs_opt.figures import COLOURS, LEFT, PAGE_IN, RIGHT, SEQUENTIAL, draw_body, new_figure, styled
from srs_opt.geometry import centre_of_rotation, rotate
from srs_opt.orbit.body import body_over_cycle, integrator
from srs_opt.simulate.rosenbrock import VELOCITY, WORK

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from srs_opt.orbit.steady import Orbit

_STROBES = 5
_MM = 1e3


@styled
def gait_figure(orbit: Orbit) -> Figure:
    """Return the gait sheet: body, valves, curvatures, speeds, envelope and friction work over a cycle."""
    robot = orbit.robot
    figure, axes = new_figure(3, 2, width_in=PAGE_IN, height_in=6.4)
    _body(axes[0, 0], orbit)
    _valves(axes[0, 1], orbit)
    _curvatures(axes[1, 0], orbit)
    _speeds(axes[1, 1], orbit)
    _reach(axes[2, 0], orbit)
    _work(axes[2, 1], orbit)
    radius = "straight" if orbit.radius_m is None else f"radius {orbit.radius_m:.3f} m"
    gait = orbit.gait
    figure.suptitle(
        f"{robot.name}: {orbit.speed_m_s:.3f} m/s, {radius}; {gait.frequency_hz:.2f} Hz, "
        f"{gait.pressure_kpa:.1f} kPa"
    )
    return figure


def _body(axes: Axes, orbit: Orbit) -> None:
    from matplotlib import colormaps

    robot, run = orbit.robot, integrator(orbit.robot, orbit.model)
    at, poses, x, y = body_over_cycle(run, orbit.time_s, orbit.pose, orbit.kappa)
    turn_rate = orbit.motion.displacement[2] / orbit.gait.period_s
    heading = (poses[:, 2] - turn_rate * at).mean()
    colours = colormaps[SEQUENTIAL]
    lowest = 0.0
    for k, i in enumerate(np.linspace(0, at.size - 1, _STROBES).astype(int)):
        # headed along the path at first, turning as it turns, and one below the other, so that the strobe
        # does not cover itself
        body_x, body_y = rotate(-heading, x[:, i] - poses[i, 0], y[:, i] - poses[i, 1])
        body_x = body_x + orbit.speed_m_s * at[i]
        body_y = body_y + lowest - body_y.max() - robot.body_width_m
        lowest = body_y.min() - 0.5 * robot.body_width_m
        draw_body(axes, body_x, body_y, robot.body_width_m, facecolor=colours(k / _STROBES))
        axes.plot(body_x[-1], body_y[-1], "o", color="black", markersize=2)
        axes.annotate(f"{at[i]:.2f} s", (body_x.min() - robot.body_width_m / 2, body_y.mean()), (-3, 0),
                      textcoords="offset points", ha="right", va="center", fontsize=6)  # fmt: skip
    axes.spines["left"].set_visible(False)
    axes.set(aspect="equal", xlabel="along the path (m)", yticks=[], title="Body over a cycle (head: dot)")


def _valves(axes: Axes, orbit: Orbit) -> None:
    gait = orbit.gait
    for i, pairs in enumerate(gait.intervals, start=1):
        axes.barh(i, gait.period_s, height=0.7, color=RIGHT, alpha=0.85)
        for on, off in pairs:
            spans = [(on, off)] if on < off else [(on, gait.period_s), (0.0, off)]
            for a, b in spans:
                axes.barh(i, b - a, left=a, height=0.7, color=LEFT)
    axes.barh(0, 0, color=LEFT, label="left chamber")
    axes.barh(0, 0, color=RIGHT, label="right chamber")
    axes.set(xlabel="time (s)", ylabel="segment (1: tail)", xlim=(0, gait.period_s), title="Valves")
    axes.set_ylim(0.4, len(gait.intervals) + 0.6)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.28), ncols=2)


def _curvatures(axes: Axes, orbit: Orbit) -> None:
    for i, curve in enumerate(orbit.kappa.T):
        axes.plot(orbit.time_s, curve, color=COLOURS[i % len(COLOURS)], label=f"{i + 1}")
    axes.set(
        xlabel="time (s)", ylabel="curvature (1/m)", xlim=(0, orbit.time_s[-1]), title="Curvatures by segment"
    )
    if orbit.kappa.shape[1] <= len(COLOURS):
        axes.legend(ncols=orbit.kappa.shape[1], loc="lower center", bbox_to_anchor=(0.5, -0.5))


def _speeds(axes: Axes, orbit: Orbit) -> None:
    solution = orbit.solution
    velocity = np.concatenate([solution.start[VELOCITY][:, None], solution.states[VELOCITY]], axis=1)
    axes.plot(orbit.time_s, velocity[0], color=COLOURS[0], label="along the body")
    axes.plot(orbit.time_s, velocity[1], color=COLOURS[1], label="across")
    axes.axhline(orbit.speed_m_s, color="black", linewidth=0.8, linestyle="--", label="mean")
    axes.set(xlabel="time (s)", ylabel="speed (m/s)", xlim=(0, orbit.time_s[-1]), title="Centre of mass")
    axes.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, -0.5))


def _reach(axes: Axes, orbit: Orbit) -> None:
    run = integrator(orbit.robot, orbit.model)
    at, poses, x, y = body_over_cycle(run, orbit.time_s, orbit.pose, orbit.kappa, 97)
    centre = centre_of_rotation(orbit.motion.displacement)
    right, left = orbit.envelope_m
    if orbit.radius_m is None or centre is None:
        along = np.array(orbit.motion.displacement[:2]) * np.sign(orbit.speed_m_s)
        along = along / max(np.hypot(*along), 1e-12)
        middle = poses[:, :2].mean(axis=0)
        lateral = along[0] * (y - middle[1]) - along[1] * (x - middle[0])
    else:
        lateral = np.sign(orbit.radius_m) * (abs(orbit.radius_m) - np.hypot(x - centre[0], y - centre[1]))
    half = orbit.robot.body_width_m / 2
    low, high = lateral.min(axis=0) - half, lateral.max(axis=0) + half
    axes.fill_between(at, _MM * low, _MM * high, color=COLOURS[5], alpha=0.6, linewidth=0)
    for value in (-right, left):
        axes.axhline(_MM * value, color="black", linewidth=0.8, linestyle="--")
    axes.set(
        xlabel="time (s)", ylabel="across the path (mm)", xlim=(0, at[-1]), title="Swept band (left is up)"
    )


def _work(axes: Axes, orbit: Orbit) -> None:
    solution = orbit.solution
    work = np.concatenate([[0.0], solution.states[WORK]])
    axes.plot(orbit.time_s, _MM * work, color=COLOURS[2])
    axes.set(
        xlabel="time (s)",
        ylabel="friction work (mJ)",
        xlim=(0, orbit.time_s[-1]),
        title="Work against friction",
    )
    axes.set_ylim(bottom=0)

"""Trajectory and circle fit at 2 Hz, 54 kPa, offset 0.4 (the paper's Fig. 10): both models and a measurement.

The measurement is a generated data set of the centre of mass, filmed at 60 Hz with 2 mm of noise.
"""

from pathlib import Path

import numpy as np

from srs_opt.figures import COLOURS, PAGE_IN, new_figure, save_figure, styled
from srs_opt.gait import published_wave
from srs_opt.measurement.circle import Circle, fit_circle
from srs_opt.measurement.dataset import load_dataset
from srs_opt.robot import wpi_srs
from srs_opt.simulate.run import simulate
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth

DURATION_S = 10.0
SETTLED_S = 2.0
MEASURED = "generated track"


def measured(folder: Path) -> np.ndarray:
    """Return the settled track of the centre of mass, (T, 2) in m, from a generated data set."""
    recording = Recording(rate_hz=60.0, marker_sd_m=0.002, markers="centre_of_mass")
    write_dataset(folder, Truth(), [Trial("fig10", 2.0, 54.0, 0.4, duration_s=DURATION_S)], 10, recording)
    (trial,) = load_dataset(folder).trials
    points = trial.centre_m[trial.time_s > SETTLED_S]
    return points[np.isfinite(points[:, 0])]


def modelled(model: str) -> np.ndarray:
    """Return the settled trajectory of a model."""
    robot = wpi_srs()
    run = simulate(robot, published_wave(robot, 2.0, 54.0, 0.4).gait(), DURATION_S, model).trajectory
    return run.pose[run.time_s > SETTLED_S, :2]


@styled
def draw(paths: dict[str, np.ndarray], circles: dict[str, Circle], stem: Path) -> None:
    """Draw each path with its circle, and how far each path is from its centre."""
    figure, panels = new_figure(2, 3, width_in=PAGE_IN, height_in=4.4, height_ratios=(1.3, 1))
    turn = np.linspace(0, 2 * np.pi, 361)
    for panel, (name, path), colour in zip(panels[0], paths.items(), COLOURS):
        circle = circles[name]
        x, y = (path - circle.centre_m).T
        panel.plot(x, y, "." if name == MEASURED else "-", color=colour, markersize=2, linewidth=0.9)
        panel.plot(circle.radius_m * np.cos(turn), circle.radius_m * np.sin(turn), "k--", linewidth=0.7)
        words = f"{1e3 * circle.radius_m:.1f}"
        words += f" ± {1e3 * circle.radius_sd_m:.1f}" if name == MEASURED else ""
        panel.set(title=f"{name}\ncircle of {words} mm", aspect="equal", xlabel="x (m)", ylabel="y (m)")
    for panel in panels[1]:
        panel.remove()
    below = figure.add_subplot(panels[1, 0].get_gridspec()[1, :])
    for (name, path), colour in list(zip(paths.items(), COLOURS))[::-1]:
        x, y = (path - circles[name].centre_m).T
        angle, away = np.arctan2(y, x) % (2 * np.pi), 1e3 * np.hypot(x, y)
        below.plot(angle, away, ".", color=colour, markersize=2, label=name)
    below.set(xlabel="angle about the circle's centre (rad)", ylabel="distance from it (mm)")
    below.legend(markerscale=3, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    save_figure(figure, stem)


def main(out: Path = Path("out/examples")) -> float:
    """Return the radius (m) of the circle through the generated track."""
    paths = {f"{model} model": modelled(model) for model in ("complex", "simplified")}
    paths[MEASURED] = measured(out / "fig10_generated")
    circles = {name: fit_circle(path) for name, path in paths.items()}
    draw(paths, circles, out / "fig10_circle")
    for name, circle in circles.items():
        off = 100 * (circle.radius_m / circles["complex model"].radius_m - 1)
        print(f"{name:17s} radius {1e3 * circle.radius_m:.1f} mm ({off:+.1f} % off the complex model)")
    return circles[MEASURED].radius_m


if __name__ == "__main__":
    main()

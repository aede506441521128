"""Trajectory and circle fit at 2 Hz, 54 kPa, offset 0.4 (the paper's Fig. 10).

The dots are a run of the virtual laboratory with camera noise: generated data stand for a measurement.
"""

from pathlib import Path

import numpy as np

from srs_opt.figures import COLOURS, new_figure, save_figure, styled
from srs_opt.gait import published_wave
from srs_opt.measurement.circle import Circle, fit_circle
from srs_opt.robot import wpi_srs
from srs_opt.simulate.run import simulate
from virtual_lab.dataset import Recording, tracks
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth

DURATION_S = 10.0
SETTLED_S = 2.0


def generated_track() -> np.ndarray:
    """Return what a camera sees of the centre of mass, (T, 2) in m."""
    recording = Recording(rate_hz=60.0, marker_sd_m=0.002, markers="centre_of_mass")
    trial = Trial("fig10", 2.0, 54.0, 0.4, duration_s=DURATION_S)
    ((_, time_s, seen),) = tracks(Truth(), [trial], seed=10, recording=recording)
    return seen.reshape(len(time_s), 2)[time_s > SETTLED_S]


@styled
def draw(run: np.ndarray, model: np.ndarray, circle: Circle, stem: Path) -> None:
    """Draw the generated track, its circle, and the model's trajectory."""
    figure, axes = new_figure(width_in=3.5, height_in=3.6)
    axes.plot(*run.T, ".", color=COLOURS[1], markersize=2, label="generated track")
    axes.plot(*model.T, color=COLOURS[0], linewidth=0.9, label="complex model")
    turn = np.linspace(0, 2 * np.pi, 361)
    x, y = circle.centre_m
    words = f"circle through the track: {1e3 * circle.radius_m:.1f} ± {1e3 * circle.radius_sd_m:.1f} mm"
    axes.plot(
        x + circle.radius_m * np.cos(turn),
        y + circle.radius_m * np.sin(turn),
        "--",
        color="black",
        label=words,
    )
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0))
    save_figure(figure, stem)


def main(out: Path = Path("out/examples")) -> float:
    """Return the radius (m) of the circle through the generated track."""
    robot = wpi_srs()
    model = simulate(robot, published_wave(robot, 2.0, 54.0, 0.4).gait(), DURATION_S).trajectory
    settled = model.pose[model.time_s > SETTLED_S, :2]
    run = generated_track()
    circle, own = fit_circle(run), fit_circle(settled)
    # both start at rest, but the track's origin is the tail and the model's the centre of mass
    shift = np.array(circle.centre_m) - own.centre_m
    draw(run, settled + shift, circle, out / "fig10_circle")
    print(f"circle fit: track {circle.radius_m:.4f} m, model {own.radius_m:.4f} m")
    return circle.radius_m


if __name__ == "__main__":
    main()

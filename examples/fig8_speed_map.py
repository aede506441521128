"""Speed of the published gait over frequency and pressure (the paper's Fig. 8): models and a measurement.

The measurement is maps.csv of a generated data set: the virtual laboratory's mean over three runs per gait.
"""

from pathlib import Path

import numpy as np

from srs_opt.figures import COLOURS, PAGE_IN, SEQUENTIAL, new_figure, save_figure, styled
from srs_opt.gait_map.grid import grid_points, map_at
from srs_opt.measurement.dataset import load_dataset
from srs_opt.robot import wpi_srs
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth

FREQUENCIES_HZ = (1.0, 1.25, 1.5, 1.75, 2.0)
PRESSURES_KPA = (41.0, 45.0, 50.0, 55.0)
POINTS = grid_points(FREQUENCIES_HZ, PRESSURES_KPA, [0.0], [np.pi / 2])
SHAPE = (len(PRESSURES_KPA), len(FREQUENCIES_HZ))
MEASURED = "generated runs"


def measured(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return mean speed and its standard deviation over the grid, from a generated data set."""
    trials = [Trial(f"g{k}", f, p) for k, (f, p, _, _) in enumerate(POINTS)]
    write_dataset(folder, Truth(), trials, 8, Recording(maps=True, tracks=False))
    rows = sorted(load_dataset(folder).maps, key=lambda row: (row.pressure_kpa, row.frequency_hz))
    mean, sd = np.array([(row.speed_m_s, row.speed_sd_m_s / row.replicates**0.5) for row in rows]).T
    return mean.reshape(SHAPE), sd.reshape(SHAPE)


@styled
def draw(speed: dict[str, np.ndarray], error: np.ndarray, stem: Path) -> None:
    """Draw the three maps, their differences from the complex model, and cuts."""
    figure, panels = new_figure(2, 3, width_in=PAGE_IN, height_in=4.2, sharex=True)
    levels = np.linspace(0.05, 0.25, 11)
    for panel, (name, field) in zip(panels[0], speed.items()):
        filled = panel.contourf(FREQUENCIES_HZ, PRESSURES_KPA, field, levels, cmap=SEQUENTIAL)
        panel.set(title=name, ylabel="pressure (kPa)")
    figure.colorbar(filled, ax=panels[0], label="speed (m/s)")
    per_cent = {name: 100 * (field / speed["complex model"] - 1) for name, field in speed.items()}
    levels = np.linspace(-8, 8, 17)
    for panel, name in zip(panels[1, 1:], ("simplified model", MEASURED)):
        filled = panel.contourf(FREQUENCIES_HZ, PRESSURES_KPA, per_cent[name], levels, cmap="RdBu_r")
        panel.set(xlabel="frequency (Hz)", ylabel="pressure (kPa)")
        panel.set_title(f"{name.split()[0]} over complex − 1")
    figure.colorbar(filled, ax=panels[1], label="difference (%)")
    cut = panels[1, 0]
    for row, colour in ((0, COLOURS[0]), (-1, COLOURS[1])):
        style = {"color": colour, "label": f"{PRESSURES_KPA[row]:g} kPa"}
        cut.plot(FREQUENCIES_HZ, speed["complex model"][row], **style)
        cut.plot(FREQUENCIES_HZ, speed["simplified model"][row], "--", color=colour)
        dots = (FREQUENCIES_HZ, speed[MEASURED][row], 2 * error[row])
        cut.errorbar(*dots, fmt="o", color=colour, markersize=3, clip_on=False)
    for style, name in (("k-", "complex"), ("k--", "simplified"), ("ko", "generated ± 2 sd")):
        cut.plot([], [], style, markersize=3, label=name)
    cut.set(xlabel="frequency (Hz)", ylabel="speed (m/s)", ylim=(0, None))
    cut.legend(loc="lower right", fontsize=6)
    save_figure(figure, stem)


def main(out: Path = Path("out/examples")) -> float:
    """Return the published gait's speed (m/s) at 2 Hz and 55 kPa in the complex model."""
    speed = {
        f"{model} model": map_at(wpi_srs(), model, POINTS).column("speed_m_s").reshape(SHAPE)
        for model in ("complex", "simplified")
    }
    speed[MEASURED], error = measured(out / "fig8_generated")
    draw(speed, error, out / "fig8_speed_map")
    for name, field in speed.items():
        off = 100 * (field / speed["complex model"] - 1)
        print(f"{name:17s} fastest {field.max():.4f} m/s, off complex {off.min():+.1f} to {off.max():+.1f} %")
    return float(speed["complex model"][-1, -1])


if __name__ == "__main__":
    main()

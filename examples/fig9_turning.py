"""Speed and radius at offset 0.4 (the paper's Fig. 9): models, a measurement, and the factor (l + L_o)/l.

The measurement is maps.csv of a generated data set. The paper's geometry has no gap and its factor makes up
for that; here the factor, applied to the model with L_o = 0, is held against the model with the gap itself.
"""

from pathlib import Path

import numpy as np

from srs_opt.figures import COLOURS, PAGE_IN, line_key, new_figure, save_figure, styled
from srs_opt.gait_map.grid import grid_points, map_at
from srs_opt.measurement.dataset import load_dataset
from srs_opt.robot import Robot, wpi_srs
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth

FREQUENCIES_HZ = (1.0, 1.25, 1.5, 1.75, 2.0)
PRESSURES_KPA = (41.0, 55.0)
POINTS = grid_points(FREQUENCIES_HZ, PRESSURES_KPA, [0.4], [np.pi / 2])
SHAPE = (2, len(PRESSURES_KPA), len(FREQUENCIES_HZ))  # speed and radius first
STYLES = {"simplified": "--", "no gap, times (l + L$_o$)/l": ":", "generated runs": "o"}


def modelled(robot: Robot, model: str) -> np.ndarray:
    """Return speed and radius of one model over the grid."""
    gaits = map_at(robot, model, POINTS)
    return np.stack([gaits.column("speed_m_s"), gaits.column("radius_m")]).reshape(SHAPE)


def measured(folder: Path) -> np.ndarray:
    """Return mean speed and radius over the grid, from a generated data set."""
    trials = [Trial(f"g{k}", f, p, offset) for k, (f, p, offset, _) in enumerate(POINTS)]
    write_dataset(folder, Truth(), trials, 9, Recording(maps=True, tracks=False))
    rows = sorted(load_dataset(folder).maps, key=lambda row: (row.pressure_kpa, row.frequency_hz))
    return np.array([(row.speed_m_s, row.radius_m) for row in rows]).T.reshape(SHAPE)


@styled
def draw(found: dict[str, np.ndarray], stem: Path) -> None:
    """Draw speed and radius, and below them the differences from the complex model."""
    figure, panels = new_figure(2, 2, width_in=PAGE_IN, height_in=4.4, sharex=True)
    for q, name in enumerate(("speed (m/s)", "radius (m)")):
        value, difference = panels[:, q]
        for k, colour in zip(range(len(PRESSURES_KPA)), COLOURS):
            base = found["complex"][q, k]
            value.plot(FREQUENCIES_HZ, base, color=colour)
            for other, line in STYLES.items():
                style = {"color": colour, "markersize": 4}
                value.plot(FREQUENCIES_HZ, found[other][q, k], line, **style)
                difference.plot(FREQUENCIES_HZ, 100 * (found[other][q, k] / base - 1), line, **style)
        difference.axhline(0, color="black", linewidth=0.6)
        value.set(ylabel=name, ylim=(0, None))
        difference.set(xlabel="frequency (Hz)", ylabel=f"{name.split()[0]} over complex − 1 (%)")
    keys = [line_key(f"{p:g} kPa", color=colour) for p, colour in zip(PRESSURES_KPA, COLOURS)]
    for name, line in {"complex": "-", **STYLES}.items():
        keys += panels[0, 0].plot([], [], line, color="black", markersize=4, label=name)
    figure.legend(handles=keys, loc="outside lower center", ncols=6)
    save_figure(figure, stem)


def main(out: Path = Path("out/examples")) -> float:
    """Return how far the factor's radius is from the full model's, mean over the grid (a ratio)."""
    robot = wpi_srs()
    factor = robot.pitch_m / robot.segment_length_m
    found = {model: modelled(robot, model) for model in ("complex", "simplified")}
    short = modelled(robot.with_values(gap_length_m=0.0), "complex")
    found["no gap, times (l + L$_o$)/l"] = factor * short
    found["generated runs"] = measured(out / "fig9_generated")
    draw(found, out / "fig9_turning")
    needed = (found["complex"] / short).mean(axis=(1, 2))
    print(f"(l + L_o)/l = {factor:.3f}; what L_o does: speed {needed[0]:.3f}, radius {needed[1]:.3f}")
    return float(factor / needed[1])


if __name__ == "__main__":
    main()

"""Speed of the published gait over frequency and pressure (the paper's Fig. 8), both models.

The dots are runs of the virtual laboratory: generated data stand for measurements here.
"""

from pathlib import Path

import numpy as np

from srs_opt.figures import COLOURS, PAGE_IN, SEQUENTIAL, new_figure, save_figure, styled
from srs_opt.gait_map.grid import GaitMap, gait_map, grid_points
from srs_opt.robot import wpi_srs
from virtual_lab.maps import steady_motion
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth

FREQUENCIES_HZ = tuple(np.linspace(1, 2, 6))
PRESSURES_KPA = (41.0, 45.0, 50.0, 55.0)
MEASURED_HZ = (1.0, 1.5, 2.0)


def simulated(model: str) -> GaitMap:
    """Return the map of one model, straight gaits."""
    return gait_map(wpi_srs(), model, grid_points(FREQUENCIES_HZ, PRESSURES_KPA, [0.0], [np.pi / 2]))


@styled
def draw(maps: dict[str, GaitMap], measured: dict[tuple[float, float], float], stem: Path) -> None:
    """Draw speed over the grid for the complex model, and cuts at both ends of the pressures."""
    figure, (field, cuts) = new_figure(1, 2, width_in=PAGE_IN, height_in=2.7)
    speed = maps["complex"].column("speed_m_s").reshape(len(PRESSURES_KPA), -1)
    filled = field.contourf(FREQUENCIES_HZ, PRESSURES_KPA, speed, 12, cmap=SEQUENTIAL)
    figure.colorbar(filled, ax=field, label="speed (m/s)")
    field.set(title="complex model, offset 0", xlabel="frequency (Hz)", ylabel="pressure (kPa)")
    for row, colour in ((0, COLOURS[0]), (-1, COLOURS[1])):
        for model, line in (("complex", "-"), ("simplified", "--")):
            values = maps[model].column("speed_m_s").reshape(len(PRESSURES_KPA), -1)[row]
            label = f"{PRESSURES_KPA[row]:g} kPa, {model}"
            cuts.plot(FREQUENCIES_HZ, values, line, color=colour, label=label)
        dots = [measured[f, PRESSURES_KPA[row]] for f in MEASURED_HZ]
        cuts.plot(MEASURED_HZ, dots, "o", color=colour, markersize=4, label="generated runs")
    cuts.set(xlabel="frequency (Hz)", ylabel="speed (m/s)", ylim=(0, None))
    cuts.legend()
    save_figure(figure, stem)


def main(out: Path = Path("out/examples")) -> float:
    """Return the published gait's speed (m/s) at 2 Hz and 55 kPa in the complex model."""
    maps = {model: simulated(model) for model in ("complex", "simplified")}
    measured = {
        (f, p): steady_motion(Truth(), Trial("run", f, p)).speed_m_s
        for f in MEASURED_HZ
        for p in (PRESSURES_KPA[0], PRESSURES_KPA[-1])
    }
    draw(maps, measured, out / "fig8_speed_map")
    fastest = {model: float(gaits.column("speed_m_s").max()) for model, gaits in maps.items()}
    print(f"fastest: complex {fastest['complex']:.4f}, simplified {fastest['simplified']:.4f} m/s")
    return float(maps["complex"].column("speed_m_s")[-1])


if __name__ == "__main__":
    main()

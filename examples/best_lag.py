"""Why the published gait is slow: the delay between segments that the paper uses is far from the best."""

import math
from pathlib import Path

import numpy as np

from srs_opt.figures import COLOURS, new_figure, save_figure, styled
from srs_opt.gait_map.grid import grid_points, map_at
from srs_opt.robot import wpi_srs

LAGS_RAD = np.linspace(0.5, 2.0, 31)
SMALL_WAVE_OPTIMUM_RAD = math.radians(50.6)  # theory for five links, small amplitude, viscous friction


@styled
def draw(speeds: dict[str, np.ndarray], stem: Path) -> None:
    """Draw speed over lag for both friction laws."""
    figure, axes = new_figure(height_in=3.0)
    for (law, speed), colour in zip(speeds.items(), COLOURS):
        axes.plot(LAGS_RAD, speed, color=colour, label=f"friction law {law}")
    axes.axvline(math.pi / 2, color="black", linestyle=":", label="the paper's lag, π/2")
    axes.axvline(SMALL_WAVE_OPTIMUM_RAD, color="grey", linestyle="--", label="small-wave theory, 50.6°")
    axes.set(xlabel="lag between segments (rad)", ylabel="speed (m/s)", title="2 Hz, 41 kPa, offset 0")
    axes.set_ylim(0, None)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.08), ncols=2)
    save_figure(figure, stem)


def main(out: Path = Path("out/examples")) -> float:
    """Return the best lag (rad) of uniform waves at 2 Hz and 41 kPa."""
    speeds = {}
    for law in ("per_axis", "cone"):
        robot = wpi_srs().with_values(friction_law=law)
        gaits = map_at(robot, "complex", grid_points([2.0], [41.0], [0.0], list(LAGS_RAD)))
        speeds[law] = gaits.column("speed_m_s")
    draw(speeds, out / "best_lag")
    best = int(np.nanargmax(speeds["per_axis"]))
    published = float(np.interp(math.pi / 2, LAGS_RAD, speeds["per_axis"]))
    print(
        f"best lag {LAGS_RAD[best]:.2f} rad: {speeds['per_axis'][best]:.3f} m/s, "
        f"{speeds['per_axis'][best] / published:.1f} times the speed at the paper's lag"
    )
    return float(LAGS_RAD[best])


if __name__ == "__main__":
    main()

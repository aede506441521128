"""Factors of the drive, measured over simulated, fitted to turns at offset 0.4.

The virtual laboratory measures them on a robot whose gap is longer than documented; the factors that the
drive fits to those generated runs play the part of the paper's (l + L_o)/l.
"""

from pathlib import Path

import numpy as np

from srs_opt.drive.calibration import fit_calibration
from srs_opt.figures import COLOURS, PAGE_IN, line_key, new_figure, save_figure, styled
from srs_opt.gait_map.grid import grid_points, map_at
from srs_opt.robot import wpi_srs
from virtual_lab.maps import steady_motion
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth

FREQUENCIES_HZ = (1.0, 1.25, 1.5, 1.75, 2.0)
PRESSURES_KPA = (41.0, 55.0)
MARKS = ("o", "s")
TRUTH = Truth(effects=({"name": "gap_length", "extra_m": 0.008},))


@styled
def draw(simulated: np.ndarray, measured: np.ndarray, factors: tuple[float, float], stem: Path) -> None:
    """Draw speed and radius; arrays are (2, pressures, frequencies)."""
    figure, panels = new_figure(1, 2, width_in=PAGE_IN, height_in=2.6)
    names = ("speed (m/s)", "radius (m)")
    for panel, model, runs, factor, name in zip(panels, simulated, measured, factors, names):
        for line, dots, colour, mark in zip(model, runs, COLOURS, MARKS):
            panel.plot(FREQUENCIES_HZ, line, "--", color=colour)
            panel.plot(FREQUENCIES_HZ, factor * line, color=colour)
            panel.plot(FREQUENCIES_HZ, dots, mark, color=colour, markersize=4, linestyle="none")
        panel.set(
            xlabel="frequency (Hz)", ylabel=name, ylim=(0, None), title=f"offset 0.4, factor {factor:.3f}"
        )
    keys = [line_key(f"{p:g} kPa", color=c, marker=m) for p, c, m in zip(PRESSURES_KPA, COLOURS, MARKS)]
    keys += [line_key("model", linestyle="--"), line_key("model times factor")]
    keys += [line_key("generated runs", linestyle="none", marker="o", markersize=4)]
    figure.legend(handles=keys, loc="outside lower center", ncols=5)
    save_figure(figure, stem)


def main(out: Path = Path("out/examples")) -> float:
    """Return the factor between measured and simulated radius."""
    points = grid_points(FREQUENCIES_HZ, PRESSURES_KPA, [0.4], [np.pi / 2])
    gaits = map_at(wpi_srs(), "complex", points)
    runs = [steady_motion(TRUTH, Trial("run", f, p, 0.4)) for f, p, _, _ in points]
    measured = np.array([[r.speed_m_s for r in runs], [r.radius_m or np.nan for r in runs]])
    simulated = np.stack([gaits.column("speed_m_s"), gaits.column("radius_m")])
    error = 0.02 * measured
    fit = fit_calibration(simulated[0], simulated[1], measured[0], error[0], measured[1], error[1])
    shape = (2, len(PRESSURES_KPA), -1)
    factors = (fit.speed.value, fit.radius.value)
    draw(simulated.reshape(shape), measured.reshape(shape), factors, out / "drive_factor")
    robot = wpi_srs()
    print(f"measured over simulated: speed {factors[0]:.3f}, radius {factors[1]:.3f}; ", end="")
    longer = (robot.pitch_m + 0.008) / robot.pitch_m
    print(f"the pitch is {longer:.3f} times the documented one")
    return factors[1]


if __name__ == "__main__":
    main()

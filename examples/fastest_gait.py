"""How fast can it go? The fastest valve timing within the paper's limits, against the published gait."""

from pathlib import Path

import matplotlib
import numpy as np

from srs_opt.figures import LEFT, PAGE_IN, RIGHT, SEQUENTIAL, line_key, new_figure, save_figure, styled
from srs_opt.gait import Gait, published_wave
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.search import search
from srs_opt.orbit.steady import Orbit, steady_gait
from srs_opt.robot import wpi_srs


def draw_valves(axes, gait: Gait) -> None:
    """Draw a cycle of valves: a row per segment."""
    durations, states = gait.phases()
    starts = durations.cumsum() - durations
    for row, valves in enumerate(states, start=1):
        for start, length, valve in zip(starts, durations, valves):
            axes.broken_barh([(start, length)], (row - 0.4, 0.8), facecolor=LEFT if valve > 0 else RIGHT)
    axes.set(xlabel="time (s)", xlim=(0, gait.period_s), yticks=range(1, gait.segments + 1))


@styled
def draw(gaits: dict[str, Orbit], stem: Path) -> None:
    """Draw the valves and the segments' curvatures of both gaits."""
    figure, panels = new_figure(2, 2, width_in=PAGE_IN, height_in=4.0, sharey="row")
    for (name, orbit), (valves, bend) in zip(gaits.items(), panels.T):
        draw_valves(valves, orbit.gait)
        valves.set_title(f"{name}: {orbit.speed_m_s:.3f} m/s at {orbit.gait.pressure_kpa:.0f} kPa")
        shades = matplotlib.colormaps[SEQUENTIAL](np.linspace(0, 0.9, orbit.gait.segments))
        for i, (kappa, shade) in enumerate(zip(orbit.kappa.T, shades), start=1):
            bend.plot(orbit.time_s, kappa, color=shade, label=f"segment {i}")
        bend.set(xlabel="time (s)", xlim=(0, orbit.gait.period_s))
    panels[0, 0].set_ylabel("segment (tail = 1)")
    panels[1, 0].set_ylabel("curvature (1/m)")
    keys = [line_key(f"bends {side}", color=c, linewidth=6) for side, c in (("left", LEFT), ("right", RIGHT))]
    keys += panels[1, 1].get_lines()
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys))
    save_figure(figure, stem)


def main(out: Path = Path("out/examples")) -> float:
    """Return the speed (m/s) of the fastest gait found from the two best starts."""
    robot = wpi_srs()
    limits = Limits(frequency_hz=(1.0, 2.0), pressure_kpa=(41.0, 55.0)).for_robot(robot)
    found = search(CycleProblem((robot,), "complex", Goal("speed"), limits), starts=2)
    best, published = found.orbits[0], steady_gait(robot, published_wave(robot).gait())
    draw({"published": published, "optimized": best}, out / "fastest_gait")
    certificate = "passed" if found.certificate.passed else "failed"
    print(
        f"published {published.speed_m_s:.3f} m/s, optimized {best.speed_m_s:.3f} m/s at "
        f"{found.gait.frequency_hz:.2f} Hz and {found.gait.pressure_kpa:.1f} kPa; certificate {certificate}"
    )
    return best.speed_m_s


if __name__ == "__main__":
    main()

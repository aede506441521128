"""How tight can it turn? The smallest radius within the paper's limits, drawn with the body."""

from pathlib import Path

import numpy as np

from srs_opt.figures import COLOURS, draw_body, new_figure, save_figure, styled
from srs_opt.gait import published_wave
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.search import search
from srs_opt.geometry import centre_of_rotation
from srs_opt.orbit.body import body_over_cycle, integrator
from srs_opt.orbit.steady import Orbit, steady_gait
from srs_opt.robot import wpi_srs


@styled
def draw(gaits: dict[str, Orbit], stem: Path) -> None:
    """Draw a turn of each gait about the same centre: path of the centre of mass and a few bodies."""
    robot = wpi_srs()
    figure, axes = new_figure(width_in=3.5, height_in=3.6)
    for (name, orbit), colour in zip(gaits.items(), COLOURS):
        centre = centre_of_rotation(orbit.motion.displacement)
        assert centre is not None and orbit.radius_m is not None
        _, _, x, y = body_over_cycle(integrator(robot), orbit.time_s, orbit.pose, orbit.kappa)
        for k in (0, 24):
            draw_body(axes, x[:, k] - centre[0], y[:, k] - centre[1], robot.body_width_m, color=colour)
        turn = np.linspace(0, 2 * np.pi, 200)
        label = f"{name}: radius {orbit.radius_m:.3f} m, {orbit.speed_m_s:.2f} m/s"
        axes.plot(orbit.radius_m * np.cos(turn), orbit.radius_m * np.sin(turn), color=colour, label=label)
    axes.plot(0, 0, "k+")
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0))
    save_figure(figure, stem)


def main(out: Path = Path("out/examples")) -> float:
    """Return the radius (m) of the tightest turn found."""
    robot = wpi_srs()
    problem = CycleProblem((robot,), "complex", Goal("turn"), Limits().for_robot(robot))
    tightest = search(problem, starts=1).orbits[0]
    published = steady_gait(robot, published_wave(robot, 2.0, 55.0, 0.4).gait())
    draw({"published, offset 0.4": published, "tightest": tightest}, out / "tightest_turn")
    assert tightest.radius_m is not None and published.radius_m is not None
    print(f"radius: published {published.radius_m:.3f} m, tightest {abs(tightest.radius_m):.3f} m")
    return abs(tightest.radius_m)


if __name__ == "__main__":
    main()

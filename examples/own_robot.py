"""A robot of your own: change a few values of the built-in one, save it, and see how it moves."""

from pathlib import Path

from srs_opt.gait import published_wave
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import load_robot, save_robot, wpi_srs


def main(out: Path = Path("out/examples")) -> float:
    """Return by how much a robot of eight links outruns the built-in one of five."""
    longer = wpi_srs().with_values(
        name="eight links",
        links=8,
        friction_tangential=0.03,
        sources={"friction_tangential": "bench"},
        relative_sd={"friction_tangential": 0.05},
    )
    file = save_robot(longer, out / "eight_links.yaml")
    speeds = []
    for robot in (wpi_srs(), load_robot(file)):
        orbit = steady_gait(robot, published_wave(robot).gait())
        right, left = orbit.envelope_m
        print(f"{robot.name}: {orbit.speed_m_s:.3f} m/s, needs a lane of {right + left:.3f} m")
        speeds.append(orbit.speed_m_s)
    return speeds[1] / speeds[0]


if __name__ == "__main__":
    main()

"""What does a soft body make of a gait that was optimized for a rigid one? Strobes beside each other."""

from pathlib import Path

from srs_opt.figures import COLOURS, PAGE_IN, draw_body, new_figure, save_figure, styled
from srs_opt.gait_opt.catalogue import shipped_table
from srs_opt.gait_opt.robust import of_stiffness
from srs_opt.gait_opt.softness import robust_gait
from srs_opt.geometry import rotate
from srs_opt.orbit.body import body_over_cycle, integrator
from srs_opt.orbit.steady import Orbit, steady_gait
from srs_opt.robot import Robot, wpi_srs

EI_N_M2 = 0.005
STROBES = 5


def main(out: Path = Path("out/examples")) -> float:
    """Return how much faster the robust gait is than the rigid optimum on a soft body (ratio)."""
    optimum = shipped_table()["fast"].gait
    rigid, soft = wpi_srs(), of_stiffness(wpi_srs(), EI_N_M2)
    shown = [
        ("rigid body, its own optimum", rigid, steady_gait(rigid, optimum)),
        (f"soft body ({EI_N_M2:g} N m²), the same gait", soft, steady_gait(soft, optimum)),
        ("soft body, the robust gait", soft, steady_gait(soft, robust_gait())),
    ]
    for name, _, orbit in shown:
        print(f"{name}: {orbit.speed_m_s:.3f} m/s")
    draw(shown, out / "soft_strobes")
    return shown[2][2].speed_m_s / shown[1][2].speed_m_s


@styled
def draw(shown: list[tuple[str, Robot, Orbit]], stem: Path) -> None:
    """Draw the body at even instants of one cycle, one below the other, a column per robot and gait."""
    stem.parent.mkdir(parents=True, exist_ok=True)
    figure, axes = new_figure(1, len(shown), width_in=PAGE_IN, height_in=3.0, sharex=True, sharey=True)
    for panel, (name, robot, orbit) in zip(axes, shown):
        at, poses, x, y = body_over_cycle(integrator(robot), orbit.time_s, orbit.pose, orbit.kappa)
        heading = poses[:, 2].mean()
        for k in range(STROBES):
            i = round(k * (at.size - 1) / (STROBES - 1))
            body_x, body_y = rotate(-heading, x[:, i] - poses[i, 0], y[:, i] - poses[i, 1])
            body_x, body_y = body_x + orbit.speed_m_s * at[i], body_y - 0.1 * k
            draw_body(panel, body_x, body_y, robot.body_width_m, facecolor=COLOURS[0 if robot.is_soft else 1])
            panel.plot(body_x[-1], body_y[-1], "o", color="black", markersize=2)
        panel.set(title=f"{name}:\n{orbit.speed_m_s:.3f} m/s", xlabel="along the path (m)", aspect="equal")
        panel.set_yticks([])
        panel.spines["left"].set_visible(False)
    save_figure(figure, stem)


if __name__ == "__main__":
    main()

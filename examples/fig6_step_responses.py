"""Step responses of a segment, lifted and on the ground (the paper's Fig. 6), from one robot file.

Our copy of the paper holds no measured value: the compliant model generates the readings, with noise.
Lifted, a segment follows its no-load curvature; on the ground the wheels' friction bends it back.
"""

from pathlib import Path

import numpy as np

from srs_opt.figures import COLOURS, new_figure, save_figure, styled
from srs_opt.measurement.actuator_bench import combine_steps
from srs_opt.measurement.bending import fit_bending
from srs_opt.measurement.records import StepTest
from srs_opt.measurement.steps import StepFit, fit_steps
from srs_opt.model.actuator_law import step_response
from srs_opt.robot import Robot, wpi_srs
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.timeline import Timeline

TIME_S, SD_1_M = np.arange(0.0, 0.8, 0.01), 0.15
SEGMENT, PRESSURES_KPA = 2, (41.0, 55.0)


def generated(robot: Robot, rng: np.random.Generator) -> tuple[StepTest, ...]:
    """Return readings of one segment of the whole snake, lifted and on the ground."""
    run, tests = Integrator(robot.with_values(friction_speed_m_s=2e-5)), []
    valve = np.eye(robot.segments)[:, [SEGMENT - 1]]
    for pressure in PRESSURES_KPA:
        path = run.integrate(Timeline.constant(np.array([0.8]), valve, pressure, 1e-9), run.rest(), 2e-6)
        for condition, curve in (("lifted", path.no_load), ("ground", path.kappa)):
            readings = np.interp(TIME_S, path.time_s, curve[:, SEGMENT - 1])
            readings += SD_1_M * rng.standard_normal(TIME_S.size)
            name = f"{condition} {pressure:g}"
            tests.append(StepTest(name, SEGMENT, condition, pressure, TIME_S, readings))
    return tuple(tests)


@styled
def draw(tests: tuple[StepTest, ...], fits: tuple[StepFit, ...], stem: Path) -> None:
    """Draw the readings and the fits of equation (14)."""
    figure, panels = new_figure(1, 2, width_in=7.2, height_in=2.6, sharey=True)
    for test, fit in zip(tests, fits):
        panel = panels[PRESSURES_KPA.index(test.pressure_kpa)]
        colour = COLOURS[test.condition == "ground"]
        s = (fit.tau1_s + fit.tau2_s) / 2
        q = ((fit.tau1_s - fit.tau2_s) / (2 * s)) ** 2
        words = f"generated, {test.condition}: {fit.c0_1_m:.1f} 1/m, {fit.tau1_s:.3f} s, {fit.tau2_s:.3f} s"
        panel.plot(test.time_s, test.curvature_1_m, ".", color=colour, markersize=2.5, alpha=0.6)
        panel.plot(TIME_S, fit.c0_1_m * step_response(TIME_S, s, q), color=colour, label=words)
        panel.set(title=f"{test.pressure_kpa:g} kPa", xlabel="time (s)")
        panel.legend(loc="lower right", title="(14) fitted: C$_0$, τ$_1$, τ$_2$", title_fontsize=7)
    panels[0].set_ylabel(f"curvature of segment {SEGMENT} (1/m)")
    save_figure(figure, stem)


def main(out: Path = Path("out/examples")) -> float:
    """Return how much further a lifted segment bends than one on the ground."""
    robot = wpi_srs().with_values(bending_stiffness_n_m2=0.005)
    tests = generated(robot, np.random.default_rng(6))
    fits = fit_steps(tests)
    bench = combine_steps(fits)
    draw(tests, fits, out / "fig6_step_responses")
    for condition in ("lifted", "ground"):
        slope, tau = bench.slope(condition), bench.constants(condition)
        print(
            f"{condition:7s} C0/p = {slope.value:.3f} +- {slope.sd:.3f} 1/m per kPa, "
            f"tau = {tau.tau1_s:.3f} and {tau.tau2_s:.3f} s"
        )
    found = fit_bending(tests, wpi_srs())
    assert found is not None and found.stiffness_n_m2 is not None and found.relative_sd is not None
    print(
        f"bending stiffness {found.stiffness_n_m2:.5f} N m^2 +- {found.relative_sd:.1%}; generated with 0.005"
    )
    return bench.slope("lifted").value / bench.slope("ground").value


if __name__ == "__main__":
    main()

"""Step responses of the segments, lifted and on the ground (the paper's Fig. 6).

Our copy of the paper holds no measured value, so the readings come from the virtual laboratory:
generated data stand for measurements here, and the picture says so.
"""

from pathlib import Path

import numpy as np

from srs_opt.figures import COLOURS, new_figure, save_figure, styled
from srs_opt.measurement.actuator_bench import combine_steps
from srs_opt.measurement.dataset import load_dataset
from srs_opt.measurement.records import StepTest
from srs_opt.measurement.steps import StepFit, fit_steps, step_response
from virtual_lab.dataset import Recording, write_dataset
from virtual_lab.trials import Trial
from virtual_lab.truth import Truth

SHOWN_SEGMENT = 1


@styled
def draw(tests: tuple[StepTest, ...], fits: tuple[StepFit, ...], stem: Path) -> None:
    """Draw one segment's readings and the fits of equation (14)."""
    figure, panels = new_figure(1, 2, width_in=7.2, height_in=2.6, sharey=True)
    for panel, pressure in zip(panels, sorted({t.pressure_kpa for t in tests})):
        for test, fit in zip(tests, fits):
            if (test.segment, test.pressure_kpa) != (SHOWN_SEGMENT, pressure):
                continue
            colour = COLOURS[test.condition == "ground"]
            fine = np.linspace(0, test.time_s[-1], 300)
            s = (fit.tau1_s + fit.tau2_s) / 2
            q = ((fit.tau1_s - fit.tau2_s) / (2 * s)) ** 2
            panel.plot(test.time_s, test.curvature_1_m, ".", color=colour, markersize=2.5, alpha=0.6)
            words = (
                f"generated, {test.condition}: {fit.c0_1_m:.1f} 1/m, {fit.tau1_s:.3f} s, {fit.tau2_s:.3f} s"
            )
            panel.plot(fine, fit.c0_1_m * step_response(fine, s, q), color=colour, label=words)
        panel.set(title=f"{pressure:g} kPa", xlabel="time (s)")
        panel.legend(loc="lower right", title="(14) fitted: C$_0$, τ$_1$, τ$_2$", title_fontsize=7)
    panels[0].set_ylabel(f"curvature of segment {SHOWN_SEGMENT} (1/m)")
    save_figure(figure, stem)


def main(out: Path = Path("out/examples")) -> float:
    """Return how much further a lifted segment bends than one on the ground."""
    trial = Trial("t1", 2.0, 55.0)
    folder = write_dataset(out / "fig6_data", Truth(), [trial], seed=6, recording=Recording(bench=True))
    tests = load_dataset(folder).bench.steps
    fits = fit_steps(tests)
    bench = combine_steps(fits)
    draw(tests, fits, out / "fig6_step_responses")
    for condition in ("lifted", "ground"):
        slope, tau = bench.slope(condition), bench.constants(condition)
        print(
            f"{condition:7s} C0/p = {slope.value:.3f} +- {slope.sd:.3f} 1/m per kPa, "
            f"tau = {tau.tau1_s:.3f} and {tau.tau2_s:.3f} s"
        )
    return bench.slope("lifted").value / bench.slope("ground").value


if __name__ == "__main__":
    main()

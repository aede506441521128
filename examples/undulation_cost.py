"""What 500 s of undulation cost to simulate (the paper's section 4.2): complex and simplified model.

The paper's own times, 94 s and 69 s, are MATLAB's on a computer of 2015; only the ratio compares.
"""

import time
from pathlib import Path

from srs_opt.figures import COLOURS, new_figure, save_figure, styled
from srs_opt.gait import published_wave
from srs_opt.robot import wpi_srs
from srs_opt.simulate.run import simulate

DURATION_S = 500.0
PAPER_S = {"complex": 94.0, "simplified": 69.0}


@styled
def draw(found: dict[str, float], stem: Path) -> None:
    """Draw the paper's times and ours."""
    figure, axes = new_figure(height_in=1.9)
    for row, model in enumerate(reversed(PAPER_S)):
        for shift, seconds, colour, label in (
            (0.2, PAPER_S[model], COLOURS[7], "paper (MATLAB, 2015)"),
            (-0.2, found[model], COLOURS[0], "srs-opt, this computer"),
        ):
            axes.barh(row + shift, seconds, 0.36, color=colour, label=label if row == 0 else None)
            axes.text(seconds, row + shift, f" {seconds:.2g} s", va="center", fontsize=7)
    axes.set(yticks=(1, 0), yticklabels=PAPER_S, xscale="log", xlim=(0.02, 1000))
    axes.set(xlabel="processor time for 500 s of undulation (s)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.25), ncols=2)
    save_figure(figure, stem)


def main(out: Path = Path("out/examples")) -> float:
    """Return the processor time (s) that the complex model takes, every period integrated."""
    robot = wpi_srs()
    gait = published_wave(robot, 2.0, 55.0).gait()
    found = {}
    for model in PAPER_S:
        seconds = []
        for _ in range(3):
            started = time.process_time()  # others may use this computer too
            run = simulate(robot, gait, DURATION_S, model)
            seconds.append(time.process_time() - started)
        found[model] = min(seconds)
        error, steps = run.error_estimate or 0.0, run.trajectory.time_s.size - 1
        print(f"{model:10s} {found[model]:.2f} s for {steps} steps, relative error {error:.0e}")
    ratio, paper = found["simplified"] / found["complex"], PAPER_S["simplified"] / PAPER_S["complex"]
    print(f"simplified over complex: {ratio:.2f}; paper {paper:.2f} of 94 s")
    draw(found, out / "undulation_cost")
    return found["complex"]


if __name__ == "__main__":
    main()

"""The benchmark as a picture: how often, how soon, and how good the plans are."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from srs_opt.figures import COLOURS, PAGE_IN, save_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from planners.benchmark.runs import Run

ROW_IN = 0.24


def save_benchmark_picture(stem: Path, found: dict[str, list[Run]], limit_s: float) -> tuple[Path, ...]:
    """Draw the runs of every maze and planner into `stem`.png and .pdf."""
    return save_figure(benchmark_figure(found, limit_s), stem)


@styled
def benchmark_figure(found: dict[str, list[Run]], limit_s: float) -> Figure:
    """Return the picture: a row per maze and planner; certified share, time to a path, plan's duration."""
    from matplotlib.figure import Figure

    rows = [
        (maze, planner, [run for run in runs if run.planner == planner])
        for maze, runs in found.items()
        for planner in dict.fromkeys(run.planner for run in runs)
    ]
    figure = Figure(figsize=(PAGE_IN, ROW_IN * len(rows) + 1.1), dpi=150, layout="constrained")
    share, time, plan = figure.subplots(1, 3, sharey=True)
    places = np.arange(len(rows))[::-1]
    for y, (_, _, runs) in zip(places, rows):
        plans = [run.duration_s for run in runs if run.duration_s is not None]
        share.barh(y, sum(run.solved for run in runs) / len(runs), color="#c8c8c8", height=0.7)
        share.barh(y, len(plans) / len(runs), color=COLOURS[0], height=0.7)
        for run in runs:
            time.plot(run.time_s, y, "o" if run.solved else "x", color=COLOURS[0 if run.solved else 1], ms=4)
        plan.plot(plans, [y] * len(plans), "o", color=COLOURS[0], ms=4)
    share.set_yticks(places, [f"{maze}  {planner}" for maze, planner, _ in rows])
    share.set(xlim=(0, 1), xlabel="share solved (grey), certified")
    time.axvline(limit_s, color="#808080", linewidth=0.8, linestyle=":")
    time.set(xlabel="planning time (s); × none found")
    time.set_xlim(left=0)
    plan.set(xlabel="duration of plan (s)")
    plan.set_xlim(left=0)
    return figure

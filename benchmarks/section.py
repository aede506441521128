"""What a benchmark returns, and how to time on a machine that others use too."""

from __future__ import annotations

import datetime
import os
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from srs_opt.figures import COLOURS, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = Path(__file__).parent / "pictures"
PACKAGES = ("srs-opt", "casadi", "numpy", "scipy", "joblib", "distributed")


@dataclass(frozen=True)
class Section:
    """One benchmark's part of the report.

    Attributes
    ----------
    title : str
    columns, rows
        The table; cells are text.
    notes : sequence of str
        Paragraphs below it.
    ratios : dict
        Named numbers that hold on any machine; smaller is better.
    pictures : sequence of Path
        PNG files.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    notes: Sequence[str] = ()
    ratios: dict[str, float] = field(default_factory=dict)
    pictures: Sequence[Path] = ()

    def markdown(self) -> str:
        lines = [f"## {self.title}", "", "| " + " | ".join(self.columns) + " |"]
        lines.append("|" + " --- |" * len(self.columns))
        lines += ["| " + " | ".join(row) + " |" for row in self.rows]
        for note in self.notes:
            lines += ["", note]
        if self.ratios:
            lines += ["", "Ratios: " + ", ".join(f"{k} {v:.3g}" for k, v in self.ratios.items()) + "."]
        for picture in self.pictures:
            lines += ["", f"![{picture.stem}](pictures/{picture.name})"]
        return "\n".join(lines) + "\n"


def best_time(work: Callable[[], object], tries: int = 5, *, processor: bool = True) -> float:
    """Return the shortest of several runs, s: processor time, or wall time where other processes work."""
    clock = time.process_time if processor else time.perf_counter
    times = []
    for _ in range(tries):
        started = clock()
        work()
        times.append(clock() - started)
    return min(times)


def exponent(sizes: Sequence[float], costs: Sequence[float]) -> float:
    """Return the slope of log cost over log size."""
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])


def growth_picture(name: str, x: str, curves: dict[str, tuple[Sequence[float], Sequence[float]]]) -> Path:
    """Draw costs over sizes, both logarithmic, with their exponents in the legend; return the PNG."""
    from srs_opt.figures import save_figure

    png, _ = save_figure(_growth_figure(x, curves), PICTURES / name)
    return png


@styled
def _growth_figure(x: str, curves: dict[str, tuple[Sequence[float], Sequence[float]]]) -> Figure:
    from matplotlib.ticker import FixedLocator, NullLocator

    figure, axes = new_figure()
    for marker, colour, (label, (sizes, costs)) in zip("os^d", COLOURS, curves.items()):
        told = f"{label}: exponent {exponent(sizes, costs):.2f}"
        axes.loglog(sizes, costs, marker=marker, markersize=3, color=colour, label=told)
    every = sorted({size for sizes, _ in curves.values() for size in sizes})
    axes.xaxis.set(major_locator=FixedLocator(every), minor_locator=NullLocator())
    axes.set_xticklabels([f"{size:.3g}" if size < 100 else f"{size:.0f}" for size in every])
    axes.set(xlabel=x, ylabel="processor time (s)")
    figure.legend(loc="outside upper left")
    return figure


def machine() -> str:
    """Return what the numbers were measured on."""
    from srs_opt.simulate.compiled import compiler

    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        model = next((line.split(":")[1].strip() for line in cpuinfo.read_text().splitlines()
                      if line.startswith("model name")), model)  # fmt: skip
    versions = []
    for package in PACKAGES:
        try:
            versions.append(f"{package} {metadata.version(package)}")
        except metadata.PackageNotFoundError:
            continue
    cc = compiler()
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return (
        f"{datetime.date.today().isoformat()}; {model}, {os.cpu_count()} cores{load}; {platform.system()}, "
        f"Python {platform.python_version()}, {', '.join(versions)}; {cc[1] if cc else 'no C compiler'}"
    )

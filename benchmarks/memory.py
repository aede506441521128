"""Peak memory of maps: measured on small ones, extrapolated to 100,000 gaits."""

from __future__ import annotations

import subprocess
import sys

import numpy as np

from benchmarks.section import Section

LIMIT_MB, LARGE = 1000.0, 100_000

# For a program of its own: getrusage alone also counts what the parent held when it forked
OWN_PEAK = r"""
def own_peak_kb():
    import re, resource, sys
    from pathlib import Path
    status = Path("/proc/self/status")
    if status.exists():
        return int(re.search(r"VmHWM:\s+(\d+)", status.read_text())[1])
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // (1024 if sys.platform == "darwin" else 1)
"""
# Rows come from a stand-in of the solver in most points, so that the sweep's own memory is seen at size
_PROGRAM = """
import sys, tempfile
from pathlib import Path
import numpy as np
from srs_opt.gait_map import grid
from srs_opt.robot import wpi_srs
count, solved = int(sys.argv[1]), sys.argv[2] == "solved"
if not solved:
    grid.map_points = lambda robot, model, points: [(*p, *[0.1] * 5) for p in points]
points = grid.grid_points(list(np.linspace(1, 2, count)), [50.0], [0.4], [1.5])
with tempfile.TemporaryDirectory() as folder:
    found = grid.map_at(wpi_srs(), "complex", points, resume=Path(folder) / "kept")
    grid.save_map(found, Path(folder) / "map.csv")
print(own_peak_kb())
"""


def peak_mb(points: int, *, solved: bool = True) -> float:
    """Return the peak memory of a process that computes, keeps and writes a map of `points` gaits."""
    command = [sys.executable, "-c", OWN_PEAK + _PROGRAM, str(points), "solved" if solved else "stand-in"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return float(done.stdout) / 1024


def run(quick: bool) -> Section:
    sizes = [100, 400] if quick else [100, 1000, 4000]
    rows, peaks = [], []
    for size in sizes:
        peaks.append(peak_mb(size))
        rows.append([f"{size} gaits", f"{peaks[-1]:.0f}"])
    slope, base = np.polyfit(sizes, peaks, 1)
    expected = base + slope * LARGE
    rows.append([f"{LARGE} gaits, extrapolated", f"{expected:.0f}"])
    notes = [
        f"Wanted: under {LIMIT_MB:.0f} MB for {LARGE} gaits. Growth: {1024 * max(slope, 0):.2f} kB per gait."
    ]
    if not quick:
        whole = peak_mb(LARGE, solved=False)
        rows.append([f"{LARGE} gaits, the solver replaced by constants", f"{whole:.0f}"])
    return Section(
        "Memory of maps",
        ["map", "peak MB"],
        rows,
        notes,
        {"expected over limit": max(expected, 0) / LIMIT_MB},
    )

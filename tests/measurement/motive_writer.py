"""Writes what Motive exports: a take with unordered labels, swaps, gaps, ghosts, any axes and units."""

from __future__ import annotations

import csv
import io

import numpy as np

ROT = {
    "y": np.array([[1.0, 0, 0], [0, 0, -1.0]]),  # x -> X, y -> -Z
    "z": np.array([[1.0, 0, 0], [0, 1.0, 0]]),
}


def motive_csv(
    tracks,
    rate_hz=120.0,
    *,
    axes=ROT["y"],
    normal=(0.0, 1.0, 0.0),
    height=0.05,
    units="Meters",
    labels=None,
    ghosts=None,
    swap_at=None,
    kind="Marker",
    take="Take 1",
    rng=None,
):
    """Return the text of a take; `tracks` (T, N, 2) in metres, NaN where lost."""
    rng = rng or np.random.default_rng(0)
    points = tracks @ axes + height * np.asarray(normal)
    points = points + rng.normal(scale=2e-4, size=points.shape[:2])[..., None] * np.asarray(normal)
    count = points.shape[1]
    order = rng.permutation(count)
    points = points[:, order]
    names = [labels[i] for i in order] if labels else [f"Unlabeled {1000 + i}" for i in range(count)]
    if swap_at is not None:
        points[swap_at:, [0, count - 1]] = points[swap_at:, [count - 1, 0]]
        points[swap_at + 40 : swap_at + 90, [1, 2]] = points[swap_at + 40 : swap_at + 90, [2, 1]]
    if ghosts is not None:
        points = np.concatenate([points, ghosts], axis=1)
        names += [f"Unlabeled {2000 + i}" for i in range(ghosts.shape[1])]
    scale = {"Meters": 1.0, "Millimeters": 1000.0}[units]
    return take_text(points * scale, names, rate_hz, units, kind, take)


def take_text(points, names, rate_hz, units, kind, take):
    out = io.StringIO()
    write = csv.writer(out, lineterminator="\r\n")
    facts = ["Format Version", "1.22", "Take Name", take, "Capture Frame Rate", f"{rate_hz:.6f}"]
    facts += ["Export Frame Rate", f"{rate_hz:.6f}", "Total Exported Frames", len(points)]
    facts += ["Rotation Type", "Quaternion", "Length Units", units, "Coordinate Space", "Global"]
    write.writerow(facts)
    write.writerow([])
    columns = [name for name in names for _ in range(3)]
    write.writerow(["", "Type"] + [kind] * len(columns))
    write.writerow(["", "Name", *columns])
    write.writerow(["", "ID", *[f"{i // 3:04d}" for i in range(len(columns))]])
    write.writerow(["", "", *["Position"] * len(columns)])
    write.writerow(["Frame", "Time (Seconds)", *["X", "Y", "Z"] * len(names)])
    for frame, row in enumerate(points):
        cells = ["" if np.isnan(v) else f"{v:.6f}" for v in row.ravel()]
        write.writerow([frame, f"{frame / rate_hz:.6f}", *cells])
    return out.getvalue()

"""Pictures: the engine's speeds and turn rates over ours; its drive among the walls beside ours."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from srs_opt.figures import COLOURS, PAGE_IN, draw_body, fill_region, new_figure, save_figure, styled
from srs_opt.judge.manoeuvres import Played
from srs_opt.judge.opinion import Opinion
from srs_opt.judge.replay import Replay

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BODIES = 16  # that are drawn along a drive


@styled
def draw_opinions(found: Sequence[Opinion], stem: Path) -> tuple[Path, Path]:
    """Draw differences over our values, with the tolerance as a band; return the files."""
    figure, (speed, turn) = new_figure(1, 2, width_in=PAGE_IN, height_in=2.8)
    known = [o for o in found if o.ours.speed_m_s is not None]
    agrees = np.array([o.agrees for o in known], dtype=bool)
    t = found[0].tolerance
    for axes, name, tolerance, unit in (
        (speed, "speed_m_s", (t.speed_share, t.speed_m_s), 1e3),
        (turn, "turn_rate_rad_s", (t.turn_share, t.turn_rate_rad_s), 1.0),
    ):
        ours, theirs = (
            np.array([getattr(seen, name) for seen in side], dtype=float)
            for side in ([o.ours for o in known], [o.judge for o in known])
        )
        _panel(axes, ours, theirs, agrees, tolerance, unit)
    speed.set_xlabel("our speed (m/s)")
    speed.set_ylabel("the engine's less ours (mm/s)")
    turn.set_xlabel("our turn rate (rad/s)")
    turn.set_ylabel("the engine's less ours (rad/s)")
    figure.suptitle(f"{int(agrees.sum())} of {len(found)} gaits agree (band: tolerance)", fontsize=9)
    return save_figure(figure, stem)


def _panel(
    axes: Axes,
    ours: np.ndarray,
    theirs: np.ndarray,
    agrees: np.ndarray,
    tolerance: tuple[float, float],
    scale: float,
) -> None:
    share, least = tolerance
    reach = 1.1 * max(np.abs(ours).max(initial=0.0), 2 * least / share)
    along = np.linspace(-reach, reach, 401) if (ours < 0).any() else np.linspace(0.0, reach, 401)
    band = scale * np.maximum(share * np.abs(along), least)
    axes.fill_between(along, -band, band, color=COLOURS[7], alpha=0.25, linewidth=0)
    axes.axhline(0.0, color=COLOURS[6], linewidth=0.6)
    for mask, colour, marker in ((agrees, COLOURS[0], "o"), (~agrees, COLOURS[1], "x")):
        axes.plot(ours[mask], scale * (theirs - ours)[mask], marker, color=colour, markersize=3.5)


@styled
def draw_replay(seen: Replay | Played, walls: Any, width_m: float, stem: Path) -> tuple[Path, Path]:
    """Draw the engine's way and bodies among the walls, if there are any, and our way; return the files."""
    if walls is None:
        room = np.concatenate([seen.lines.min((0, 1)) - width_m, seen.lines.max((0, 1)) + width_m])
    else:
        room = walls.bounds
    xmin, ymin, xmax, ymax = room
    height_in = PAGE_IN * min(max((ymax - ymin) / (xmax - xmin), 0.25), 1.0) + 0.6
    figure, axes = new_figure(1, 1, width_in=PAGE_IN, height_in=height_in)
    if walls is not None:
        fill_region(axes, walls, color=COLOURS[7], alpha=0.8)
    shown = np.linspace(0, len(seen.lines) - 1, BODIES).round().astype(int)
    for k in shown:
        draw_body(axes, seen.lines[k, :, 0], seen.lines[k, :, 1], width_m, color=COLOURS[5], alpha=0.5)
    axes.plot(*seen.ours.T, color=COLOURS[6], linewidth=0.8, linestyle="--", label=f"ours ({seen.name})")
    axes.plot(*seen.centre.T, color=COLOURS[1], linewidth=1.0, label="the engine")
    if isinstance(seen, Replay) and seen.first_contact_s is not None:
        at = seen.centre[int(np.searchsorted(seen.time_s, seen.first_contact_s))]
        axes.plot(*at, "x", color=COLOURS[3], label="first contact")
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    figure.legend(loc="outside upper center", ncols=3)
    return save_figure(figure, stem)

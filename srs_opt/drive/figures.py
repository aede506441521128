"""Picture of the motions that the differential drive reaches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import shapely
import shapely.affinity

from srs_opt.figures import COLOURS, fill_region, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from srs_opt.drive.drive import Drive, DriveGait


@styled
def reachable_figure(drive: Drive, chosen: DriveGait | None = None) -> Figure:
    """Return the reachable set of speed and turn rate, forward and reverse."""
    figure, axes = new_figure(width_in=3.5, height_in=2.8)
    reachable = drive.reachable()
    for sign, colour, label in ((1, COLOURS[0], "forward"), (-1, COLOURS[1], "reverse")):
        side = shapely.affinity.scale(reachable, sign, 1, origin=(0, 0))
        fill_region(axes, side, color=colour, alpha=0.35, label=label)
    grid = drive.corners[:, :, 4:6].reshape(-1, 2)
    axes.plot(grid[:, 0], grid[:, 1], ".", color=COLOURS[6], markersize=1.5, label="gaits of the map")
    if chosen is not None:
        axes.plot(
            chosen.speed_m_s, chosen.turn_rate_rad_s, "*", color=COLOURS[2], markersize=9, label="chosen"
        )
    axes.set_xlabel("speed (m/s), + forward")
    axes.set_ylabel("turn rate (rad/s), + left")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.18), ncols=2)
    return figure

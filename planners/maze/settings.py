"""How mazes are tabulated, and what files of other programs leave open."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class DistanceSettings:
    """Distances to the nearest wall.

    Attributes
    ----------
    finest_m : float
        Spacing of the table where nothing else is wanted. Half takes four times the memory; the error,
        which sends points to the exact distance, goes with it.
    nodes : int
        To which the table grows without a wanted spacing, or to one node per cell of an occupancy grid.
    most_nodes : int
        Bound on its size: finer tables are coarsened. Peak memory is about 30 bytes per node.
    cells_at_once : int
        Cells of an occupancy grid that are worked on together, which bounds memory.
    looked_cells : int
        Distance, in cells, up to which points look at the cells about them together; beyond, one by one.
    chords : int
        Per quarter of a circle, of the polygons that contain round walls.
    """

    finest_m: float = 0.005
    nodes: int = 4_000_000
    most_nodes: int = 16_500_000
    cells_at_once: int = 1_000_000
    looked_cells: int = 16
    chords: int = 16

    @property
    def containing(self) -> float:
        """Circumradius, over the disc's radius, of a polygon with so many corners that contains the disc."""
        return 1.0 / math.cos(math.pi / (4 * self.chords))


@dataclass(frozen=True)
class MapFileSettings:
    """What map files leave open.

    Attributes
    ----------
    world_margin_m : float
        About the obstacles of a Gazebo world, which has no bounds: the BARN benchmark drives to goals
        beyond.
    upright_rad : float
        Tilt up to which an obstacle's outline on the floor is taken as if it stood upright.
    lossy_levels : int
        Grey levels by which JPEG moves flat areas.
    movingai_cell_m : float
        Side of a cell of a Moving AI map, which has no unit: one cell is as wide as a slim gait needs.
    """

    world_margin_m: float = 4.0
    upright_rad: float = 0.05
    lossy_levels: int = 4
    movingai_cell_m: float = 0.1


DISTANCE = DistanceSettings()
MAP_FILE = MapFileSettings()

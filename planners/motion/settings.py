"""What the motion table is simulated with."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MotionTableSettings:
    """Every change of gait, simulated.

    Attributes
    ----------
    still : float
        Displacement per cycle, in body widths, below which a gait has no direction of travel.
    levels : int
        Forward speeds per gait before, between which the table is interpolated; memory and time go with it.
    step_s : float
        Of the integration: 1e-4 of the distance travelled in a cycle.
    speed_margin : float
        The levels reach beyond the fastest gait by this factor.
    controller_levels : tuple of float
        For the controller's table: shares of the fastest gait's speed, in the direction of the gait before,
        at which its cycle begins; where it ends are the levels. Wider ones interpolate worse between,
        narrower ones leave speeds out that occur.
    """

    still: float = 0.25
    levels: int = 8
    step_s: float = 0.003
    speed_margin: float = 1.1
    controller_levels: tuple[float, float, float] = (0.0, 0.4, 0.85)


MOTION_TABLE = MotionTableSettings()

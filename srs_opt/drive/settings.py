"""When a gait of the differential drive makes the wanted motion."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DriveMapSettings:
    """The inverse map, from a wanted motion to a gait.

    Attributes
    ----------
    lever : float
        Distance at which turn rates count as speeds when motions are compared, body lengths (0.1 m of the
        built-in robot).
    refinements : int
        Steps of Newton's method with a triangle's derivatives, each of which simulates a gait.
    tolerance : float
        Miss at which they end, over the wanted speed.
    slow : float
        Speed, in body lengths per second, that this counts from at least.
    most_m_s, most_rad_s : float
        Wanted motions beyond are refused as no snake's: geometry with 1e308 overflows.
    """

    lever: float = 0.423728813559322
    refinements: int = 3
    tolerance: float = 1e-3
    slow: float = 0.0847457627118644
    most_m_s: float = 100.0
    most_rad_s: float = 1000.0


DRIVE_MAP = DriveMapSettings()

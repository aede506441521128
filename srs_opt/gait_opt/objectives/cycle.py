"""One steady cycle of a gait as objectives and constraints see it: CasADi expressions with units."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

SAMPLES = 32  # of the curvatures over a cycle
SCALARS = (
    "speed_m_s",
    "turn_rate_rad_s",
    "friction_work_j",
    "air_work_j",
    "left_m",
    "right_m",
    "frequency_hz",
    "pressure_kpa",
    "weight_n",
)


@dataclass(frozen=True)
class GaitCycle:
    """One cycle of a steady gait of one robot.

    All are CasADi expressions: use CasADi's functions on them (``casadi.sqrt``, ``casadi.fmax``), no ``if``.

    Attributes
    ----------
    speed_m_s, turn_rate_rad_s : (1, 1)
        Mean motion; negative backwards, + left.
    friction_work_j, air_work_j : (1, 1)
        Per cycle, lost to friction and spent on filling chambers.
    left_m, right_m : (1, 1)
        Reach of the body to either side of its mean path.
    frequency_hz, pressure_kpa : (1, 1)
    weight_n : (1, 1)
        The robot's.
    on, off : (segments, K)
        Switch times as fractions of the cycle after the first one; on < off < on + 1.
    curvature_1_m : (segments, 32)
        At even instants over the cycle, from the first switch on.
    """

    speed_m_s: ca.SX
    turn_rate_rad_s: ca.SX
    friction_work_j: ca.SX
    air_work_j: ca.SX
    left_m: ca.SX
    right_m: ca.SX
    frequency_hz: ca.SX
    pressure_kpa: ca.SX
    weight_n: ca.SX
    on: ca.SX
    off: ca.SX
    curvature_1_m: ca.SX

    @property
    def band_m(self) -> ca.SX:
        """Total width of the swept band."""
        return self.left_m + self.right_m

    @property
    def distance_m(self) -> ca.SX:
        """Way per cycle, either direction, never quite zero."""
        return ca.fmax(ca.fabs(self.speed_m_s), 1e-9) / self.frequency_hz

    @property
    def radius_m(self) -> ca.SX:
        """Size of the mean path's radius; huge when straight."""
        return ca.fabs(self.speed_m_s) / ca.fmax(ca.fabs(self.turn_rate_rad_s), 1e-9)

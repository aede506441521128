"""The coordinates that a fit moves in: logs of the robot's parameters, and the effects' sizes.

Every effect enters through coordinates in which it is absent at zero and smooth around it, one set per place,
so that one linearisation without any effect sees all effects at all places (see `srs_opt.calibrate.forms`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from srs_opt.calibrate.fit_settings import PRIOR
from srs_opt.model.parameters import COMPLIANCE_PARAMETERS
from srs_opt.robot import Robot

INFINITY = math.inf
FRICTION_SPEED = "friction_speed_m_s"
# standard deviations assumed for what the robot file gives none (relative)
ASSUMED_SD = {
    "friction_tangential": 0.10,
    "friction_normal": 0.10,
    "curvature_per_pressure_1_m_kpa": 0.05,
    "tau1_s": 0.10,
    "tau2_s": 0.10,
}
SCATTER_SD = {
    "friction_tangential": 0.03,
    "friction_normal": 0.03,
    "curvature_per_pressure_1_m_kpa": 0.01,
}


@dataclass(frozen=True)
class Coordinate:
    """One direction of a fit.

    Attributes
    ----------
    name : str
        A robot parameter (its log over the bench value), or ``effect.part``.
    effect : str
        The effect that it belongs to; empty for robot parameters.
    typical : float
        Size at which the effect begins to matter (1 for logs).
    lower : float
        Physical bound.
    prior_sd : float
        Standard deviation about `start` (infinite: free).
    start : float
        Value before any fit; for scales (width, speed, nearness) the typical log.
    log : bool
        Whether it is the logarithm of an effect's scale.
    """

    name: str
    effect: str = ""
    typical: float = 1.0
    lower: float = -INFINITY
    prior_sd: float = INFINITY
    start: float = 0.0
    log: bool = False

    @property
    def fixed(self) -> bool:
        """Whether the fit leaves it where it is; trials may still scatter about it."""
        return self.prior_sd <= PRIOR.fixed_sd

    @property
    def reported(self) -> bool:
        """Whether it is a result: neither fixed nor a nuisance of the fit."""
        return not self.fixed and self.name != FRICTION_SPEED


def base_coordinates(robot: Robot) -> tuple[Coordinate, ...]:
    """Return the calibrated robot parameters: those with a bench deviation, and the nuisance v_s.

    The stiffness of a body that bends under load is among them where it has one.

    A deviation of 0 fixes a parameter. One that trials scatter about stays a coordinate, with
    `PriorSettings.fixed_sd`: the scatter needs its derivatives.
    """
    sds = {**ASSUMED_SD, **robot.relative_sd}
    free = {n for n, sd in sds.items() if sd > 0 and n in _CALIBRATED and (getattr(robot, n) or 0) > 0}
    chosen = [
        Coordinate(name, prior_sd=sds[name] if name in free else PRIOR.fixed_sd)
        for name in _CALIBRATED
        if name in free or name in SCATTER_SD
    ]
    low, high = (math.log(v / robot.friction_speed_m_s) for v in PRIOR.friction_speed_range_m_s)
    # the range's half width as a standard deviation about its middle, in logarithms
    speed = Coordinate(FRICTION_SPEED, prior_sd=(high - low) / 2, start=(high + low) / 2, lower=low - 0.2)
    return (*chosen, speed)


_CALIBRATED = (
    *ASSUMED_SD,
    "segment_length_m",
    "gap_length_m",
    "link_mass_kg",
    "link_inertia_kg_m2",
    *COMPLIANCE_PARAMETERS,
)

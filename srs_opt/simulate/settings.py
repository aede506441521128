"""How a mesh follows a motion, and what is read from a simulated one."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class StepSettings:
    """The steps of a mesh that is adapted.

    Attributes
    ----------
    largest_change : float
        Factor at most by which a step becomes shorter or longer at once: estimates of the error hold no
        further.
    beside : float
        Share of a step's density of new steps that its neighbours get at least: features move a little when
        steps change.
    most_per_s, most : int
        Of a motion that still deserves the name; parameters far from any robot's ask for millions, and
        gigabytes.
    """

    largest_change: float = 4.0
    beside: float = 0.7
    most_per_s: int = 50_000
    most: int = 20_000


@dataclass(frozen=True)
class MotionSettings:
    """What is reported of a motion.

    Attributes
    ----------
    straight_radius_m : float
        A larger radius is reported as straight.
    checked_cycles : int
        Integrated again for the estimate of the error: friction and valves repeat, and so does the error.
    finer : float
        Ratio of the tolerances of the two integrations; the finer one's error is then negligible.
    """

    straight_radius_m: float = 50.0
    checked_cycles: int = 4
    finer: float = 16.0


STEP = StepSettings()
MOTION = MotionSettings()

"""How a gait that was found for a rigid body moves a soft one."""

from __future__ import annotations

from functools import lru_cache
from importlib import resources

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.gait_opt.corrections import within
from srs_opt.gait_opt.goal import Limits
from srs_opt.gait_opt.robust import of_stiffness
from srs_opt.gait_opt.settings import STIFFNESS
from srs_opt.orbit.steady import steady_gaits
from srs_opt.robot import Robot


def speeds_at_stiffness(robot: Robot, gaits: list[Gait]) -> list[list[float | None]]:
    """Return the speeds from rest (m/s) of every gait at the stiffnesses of silicone.

    They are `STIFFNESS.silicone_n_m2`; None where a gait has no steady motion. Empty lists for a robot that
    has a stiffness of its own, or too many links.
    """
    if robot.is_soft or robot.links > STIFFNESS.most_links:
        return [[] for _ in gaits]
    found: list[list[float | None]] = [[] for _ in gaits]
    for ei in STIFFNESS.silicone_n_m2:
        for speeds, orbit in zip(found, steady_gaits(of_stiffness(robot, ei), gaits)):
            speeds.append(None if isinstance(orbit, NoAnswerError) else orbit.speed_m_s)
    return found


@lru_cache(maxsize=1)
def robust_gait() -> Gait:
    """Return the gait with the best worst speed, relative to the published gait, over silicone's stiffnesses.

    It was found for the built-in robot's segments at 1 to 2 Hz and 41 to 55 kPa.
    """
    import json

    file = resources.files("srs_opt.gait_opt").joinpath("robust_gait.json")
    return Gait.of_record(json.loads(file.read_text(encoding="utf-8")))


def robust_beside(robot: Robot, limits: Limits) -> Gait | None:
    """Return the robust gait within `limits`, None for robots with another number of segments."""
    gait = robust_gait()
    return within(limits, gait) if gait.segments == robot.segments else None

"""The judges by name: other simulators that play the same gait, built in or registered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from srs_opt.gait import Gait
from srs_opt.judge.bodies import check_engine, check_robot
from srs_opt.judge.gaits import Judged, judge_gait
from srs_opt.judge.settings import EngineSettings
from srs_opt.registry import Registry
from srs_opt.robot import Robot


@dataclass(frozen=True)
class Judge:
    """Another simulator of the robot, which shares no equation with this library.

    Attributes
    ----------
    name : str
    check_engine : callable
        Raises InputError, saying what to install, where it cannot run.
    check_robot : callable
        Robot -> None; raises InputError where it cannot stand for the robot.
    judge_gait : callable
        (robot, gait, settings, refine) -> `Judged`, the steady motion; ``refine``: with its numerical error.
    """

    name: str
    check_engine: Callable[[], None]
    check_robot: Callable[[Robot], None]
    judge_gait: Callable[[Robot, Gait, EngineSettings, bool], Judged]


def _dart(robot: Robot, gait: Gait, settings: EngineSettings, refine: bool) -> Judged:
    return judge_gait(robot, gait, settings, refine=refine)


DART = Judge("dart", check_engine, check_robot, _dart)
JUDGES: Registry[Judge] = Registry("judge", lambda: {DART.name: DART}, lambda thing: isinstance(thing, Judge))


def register_judge(judge: Judge) -> Judge:
    """Make a judge of your own known: ``python -m srs_opt.judge --engine NAME`` then asks it about gaits.

    Raises
    ------
    InputError
        If the name is taken or no plain word.
    """
    return JUDGES.register(judge)

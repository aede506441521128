"""Our motion of a gait beside the engine's, and whether the two agree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait, check_gait
from srs_opt.judge.gaits import Judged
from srs_opt.judge.registry import DART, JUDGES
from srs_opt.judge.settings import AGREEMENT, ENGINE, REPLAY, AgreementSettings, EngineSettings
from srs_opt.orbit.steady import steady_gait
from srs_opt.parallel import executor
from srs_opt.parallel.sweep import Resume, sweep
from srs_opt.robot import Robot


@dataclass(frozen=True)
class Ours:
    """Our steady motion, None throughout where the model finds none."""

    speed_m_s: float | None
    turn_rate_rad_s: float | None
    radius_m: float | None


@dataclass(frozen=True)
class Opinion:
    """What both say of one gait."""

    name: str
    ours: Ours
    judge: Judged
    tolerance: AgreementSettings

    @property
    def agrees(self) -> bool:
        """Whether speed and turn rate are within tolerance."""
        if self.ours.speed_m_s is None or self.ours.turn_rate_rad_s is None:
            return False
        t = self.tolerance
        speed, turn = self.ours.speed_m_s, self.ours.turn_rate_rad_s
        speed_ok = abs(self.judge.speed_m_s - speed) <= max(t.speed_share * abs(speed), t.speed_m_s)
        turn_ok = abs(self.judge.turn_rate_rad_s - turn) <= max(t.turn_share * abs(turn), t.turn_rate_rad_s)
        return speed_ok and turn_ok

    def to_record(self) -> dict[str, Any]:
        """Return the JSON object."""
        known = self.ours.speed_m_s is not None and self.ours.turn_rate_rad_s is not None
        return {
            "name": self.name,
            "ours": dict(vars(self.ours)),
            "judge": self.judge.to_record(),
            "difference": {
                "speed_m_s": self.judge.speed_m_s - self.ours.speed_m_s if known else None,  # type: ignore[operator]
                "turn_rate_rad_s": self.judge.turn_rate_rad_s - self.ours.turn_rate_rad_s if known else None,  # type: ignore[operator]
            },
            "agrees": self.agrees,
        }

    def in_words(self) -> str:
        """Return the opinion on one gait in a line."""
        them, us = self.judge, self.ours
        word = "agrees" if self.agrees else "DISAGREES"
        error = "" if them.speed_error_m_s is None else f" ± {them.speed_error_m_s:.4f}"
        mine = "none" if us.speed_m_s is None else f"{us.speed_m_s:.4f} m/s, {us.turn_rate_rad_s:+.3f} rad/s"
        return f"{word}: {them.speed_m_s:.4f}{error} m/s, {them.turn_rate_rad_s:+.3f} rad/s; ours {mine}"


def ours_of(robot: Robot, gait: Gait, model: str | None) -> Ours:
    """Return our steady motion, with friction no more smoothed than `ReplaySettings` says."""
    sharp = robot.with_values(friction_speed_m_s=min(robot.friction_speed_m_s, REPLAY.friction_speed_m_s))
    try:
        orbit = steady_gait(sharp, gait, model)
    except NoAnswerError:
        return Ours(None, None, None)
    return Ours(orbit.speed_m_s, orbit.turn_rate_rad_s, orbit.radius_m)


def opinion_on(
    robot: Robot,
    name: str,
    gait: Gait,
    model: str | None = None,
    settings: EngineSettings = ENGINE,
    tolerance: AgreementSettings = AGREEMENT,
    *,
    refine: bool = True,
    engine: str = DART.name,
) -> Opinion:
    """Return both motions of one gait; `engine` names the judge.

    Raises
    ------
    InputError
        If gait and robot do not belong together, or the engine cannot stand for the robot.
    """
    check_gait(robot, gait)
    judged = JUDGES.named(engine).judge_gait(robot, gait, settings, refine)
    return Opinion(name, ours_of(robot, gait, model), judged, tolerance.of_body(robot.length_m))


@dataclass(frozen=True)
class Case:
    """A gait to be judged."""

    name: str
    gait: Gait
    refine: bool


def opinions(
    robot: Robot,
    cases: Sequence[Case],
    model: str | None = None,
    settings: EngineSettings = ENGINE,
    tolerance: AgreementSettings = AGREEMENT,
    *,
    jobs: int = 1,
    cluster: str | None = None,
    quiet: bool = True,
    resume: Resume | None = None,
    engine: str = DART.name,
) -> list[Opinion]:
    """Return the opinions on many gaits, in order."""
    work = partial(_chunk, robot, model, settings, engine)
    with executor(jobs, cluster) as where:
        rows = list(
            sweep(work, list(cases), chunk=1, where=where, what="judging", quiet=quiet, resume=resume)
        )
    return [
        Opinion(case.name, Ours(*ours), Judged(**judged), tolerance.of_body(robot.length_m))
        for case, (ours, judged) in zip(cases, rows)
    ]


def _chunk(
    robot: Robot, model: str | None, settings: EngineSettings, engine: str, cases: Sequence[Case]
) -> list[Any]:
    """Return the opinions on some gaits as JSON holds them."""
    found = []
    for case in cases:
        opinion = opinion_on(robot, case.name, case.gait, model, settings, refine=case.refine, engine=engine)
        found.append([list(vars(opinion.ours).values()), dict(vars(opinion.judge))])
    return found

"""What a named effect is worth: the fastest gaits of calibrated and corrected robot, on the corrected one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from srs_opt.calibrate.result import calibrated_robot
from srs_opt.discrepancy.answer import corrected_robot
from srs_opt.discrepancy.gap_settings import PAYOFF
from srs_opt.discrepancy.pipeline import Discrepancy
from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.search import search
from srs_opt.model.parameters import room_effects
from srs_opt.orbit.steady import Orbit, steady_gait
from srs_opt.robot import Robot


@dataclass(frozen=True)
class Payoff:
    """Straight gaits, each the fastest of one robot.

    Attributes
    ----------
    promised : Orbit
        Optimized for the calibrated robot, and simulated on it.
    before : Orbit
        The same gait simulated on the corrected robot: what the promise is worth.
    after : Orbit
        Optimized for the corrected robot, and simulated on it.
    left_out : tuple of str
        Effects that know the room: no steady gait shows them.
    calibrated, corrected : Robot
    """

    promised: Orbit
    before: Orbit
    after: Orbit
    left_out: tuple[str, ...]
    calibrated: Robot
    corrected: Robot

    def to_record(self) -> dict[str, Any]:
        """Return the `payoff` entry of the command's JSON."""
        orbits = {"promised": self.promised, "before": self.before, "after": self.after}
        return {
            **{
                name: {"speed_m_s": orbit.speed_m_s, "turn_rate_rad_s": orbit.turn_rate_rad_s}
                for name, orbit in orbits.items()
            },
            "gait_before": self.before.gait.record(),
            "gait_after": self.after.gait.record(),
            "effects_left_out": list(self.left_out),
        }

    def in_words(self) -> str:
        """Return two sentences."""
        said = (
            f"the calibrated robot's fastest straight gait promises {self.promised.speed_m_s:.3f} m/s; "
            f"on the corrected robot it makes {_motion(self.before)}. The corrected robot's own makes "
            f"{_motion(self.after)}"
        )
        if self.left_out:
            said += f" (without {', '.join(self.left_out)}: no steady gait shows what depends on the room)"
        return said


def _motion(orbit: Orbit) -> str:
    turn = round(orbit.turn_rate_rad_s, 3)
    return f"{orbit.speed_m_s:.3f} m/s" + (f" and turns by {turn:+.3f} rad/s" if turn else ", straight")


def payoff(
    found: Discrepancy, model: str | None = None, tell: Callable[[str], None] = lambda message: None
) -> Payoff | None:
    """Return what the named effects change; None where none was named, or where a robot has no gait.

    Parameters
    ----------
    found : Discrepancy
    model : {"complex", "simplified", "compliant"}, optional
        With which it was found; a robot that bends under load takes the compliant model.
    tell : callable
        Gets messages about the progress.
    """
    after = corrected_robot(found)
    if not found.believed or after is None or found.null is None:
        return None
    before = calibrated_robot(found.dataset.robot, found.null.hypothesis.fit)
    try:
        gaits = [_fastest(robot, model, tell) for robot in (before, after)]
        return Payoff(
            steady_gait(before, gaits[0], _model_of(before, model)),
            steady_gait(after, gaits[0], _model_of(after, model)),
            steady_gait(after, gaits[1], _model_of(after, model)),
            tuple(room_effects(after)),
            before,
            after,
        )
    except NoAnswerError as error:
        tell(f"the effect on optimization and planning is not shown: {error}")
        return None


def _model_of(robot: Robot, model: str | None) -> str:
    return robot.own_model if robot.is_soft or model is None else model


def _fastest(robot: Robot, model: str | None, tell: Callable[[str], None]) -> Gait:
    tell(f"optimizing the fastest gait of '{robot.name}'{' with its effects' if robot.effects else ''}")
    problem = CycleProblem((robot,), _model_of(robot, model), Goal("speed"), Limits().for_robot(robot))
    return search(problem, starts=PAYOFF.starts).gait

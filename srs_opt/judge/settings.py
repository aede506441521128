"""How the other engine is played, when its motion counts as steady, and when two motions agree.

Lengths are in body lengths, speeds in body lengths per second where the name says so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from dart_snake.engine import STEP_S


@dataclass(frozen=True)
class EngineSettings:
    """How finely the engine plays.

    Attributes
    ----------
    step_s : float
        Half: twice the time, and the error of contact is half as large; `refine` reports the difference.
    pairs : int
        Of hinges per segment, at thirds of equal arcs; `refine` doubles them.
    """

    step_s: float = STEP_S
    pairs: int = 1


@dataclass(frozen=True)
class SettlingSettings:
    """When a gait that is played from rest counts as steady.

    Attributes
    ----------
    samples_per_cycle : int
        Rows by which a cycle's mean motion is measured.
    least_cycles, most_cycles : int
        Played before the motion may count as steady, and at all. Two differences of three changes are needed,
        so fewer than 4 say nothing.
    remaining_share : float
        What may remain of the approach to the steady motion, over the motion itself. The approach is
        geometric, so the last changes tell its ratio and what is still to come. Half: about one cycle more
        where a cycle halves the distance; double: an error of a thousandth, a twentieth of the tolerance.
    slowest_ratio : float
        Most of a cycle's distance from the steady motion that the next is taken to keep: noise in small
        changes would else look like a motion that never settles.
    lever_body : float
        Turn rates weigh as speeds at this distance, in body lengths.
    least_change_body_s : float
        Change of speed, body lengths per second, that is never asked about: well below the tolerance of the
        comparison.
    averaged_cycles : int
        That are averaged when cycles never repeat.
    """

    samples_per_cycle: int = 48
    least_cycles: int = 6
    most_cycles: int = 80
    remaining_share: float = 5e-4
    slowest_ratio: float = 0.95
    lever_body: float = 0.1 / 0.236
    least_change_body_s: float = 2e-5 / 0.236
    averaged_cycles: int = 12


@dataclass(frozen=True)
class AgreementSettings:
    """Up to which differences the engine's motion and ours agree: a share of ours, or that much if more.

    Attributes
    ----------
    speed_share, turn_share : float
        Contact solvers and step sizes leave a few parts in a thousand, another friction law 40 %.
    speed_body_s, turn_rate_rad_s : float
        For slow and for straight gaits, which have no speed or turn rate to take a share of: 2 mm/s of the
        built-in robot, and that at 0.42 lengths (0.1 m) from the middle of the body.
    drift_share : float
        Distance between the motions, played open loop, over the distance travelled: small differences of
        speed and turn rate add up.
    least_drift_body : float
        The same near the start, in body lengths: 10 mm of the built-in robot.
    body_m : float
        The body's length.
    """

    speed_share: float = 0.02
    turn_share: float = 0.03
    speed_body_s: float = 0.002 / 0.236
    turn_rate_rad_s: float = 0.02
    drift_share: float = 0.03
    least_drift_body: float = 0.01 / 0.236
    body_m: float = 0.236

    def of_body(self, length_m: float) -> AgreementSettings:
        """Return the rule for a robot of that length."""
        return replace(self, body_m=length_m)

    @property
    def speed_m_s(self) -> float:
        """Difference of speeds that always agrees, m/s."""
        return self.speed_body_s * self.body_m

    def to_record(self) -> dict[str, float]:
        """Return what a gait is compared by, as judge.json holds it."""
        return {
            "speed_share": self.speed_share,
            "turn_share": self.turn_share,
            "speed_m_s": round(self.speed_m_s, 9),
            "turn_rate_rad_s": self.turn_rate_rad_s,
        }


@dataclass(frozen=True)
class ReplaySettings:
    """How our model and the engine are set up to be comparable.

    Attributes
    ----------
    friction_speed_m_s : float
        Our friction is smoothed over no more than this; the engine's Coulomb friction is not smoothed at all.
        Larger: our steady motion differs by the smoothing instead of by physics; smaller: it takes longer.
    tether_speed_m_s : float
        Below it the engine's dragging tether pulls less, so that its direction is defined at rest; far below
        the speed of a snake that moves.
    stair_s : float
        Step in which the engine is given a pressure that changes steadily.
    steps_per_row : int
        Engine steps between two recorded poses; contact between them is noticed all the same.
    cycles_before : int
        Cycles of the gait in which a manoeuvre begins: the built-in table's slowest multiplier leaves 3 % of
        a disturbance after so many.
    """

    friction_speed_m_s: float = 3e-4
    tether_speed_m_s: float = 1e-3
    stair_s: float = 0.005
    steps_per_row: int = 10
    cycles_before: int = 12


ENGINE = EngineSettings()
SETTLING = SettlingSettings()
AGREEMENT = AgreementSettings()
REPLAY = ReplaySettings()

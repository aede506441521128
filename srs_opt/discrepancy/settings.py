"""When an explanation is believed: the figures that a laboratory judges by, all on sealed trials.

Lengths are in body lengths, so that they mean the same for a robot twice as long.
"""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class AdequacySettings:
    """The rule of adequacy.

    With enough data every model is rejected: the statistics only say whether something is left. Whether it
    counts is judged by its size.

    Attributes
    ----------
    detected : float
        Level at which calibration alone is rejected.
    left_share, left : float
        What a named set of effects may leave where what is left is significant: share of the gap (root mean
        squares beyond the noise), and body lengths. Simulations and cameras leave 0.001 to 0.0017 (0.2 to
        0.4 mm of a body of 236 mm) whatever the gap; wrong sets close up to 93 % of a large gap and leave
        millimetres.
    small, small_share : float
        A remainder of this size is what cameras and simulations leave: it does not count against a name as
        long as it is no larger share of the gap than `small_share`.
    speed_share : float
        Error of the predicted speed that a named set may leave.
    part_share : float
        Share of the gap that effects may leave which are named as a part of what is missing.
    part_effects : int
        How many effects may be named as a part: three can absorb most of any gap.
    part_lead : float
        Share of the gap by which every set without such an effect must leave more.
    part_change : float
        By how much of itself the size of such an effect may change when a third of the trials is left out.
    negligible, negligible_speed : float
        A gap below both is none that matters, where no effect explains it.
    off, off_times : float
        Root mean square from which on a single sealed trial, beyond `off_times` what the others leave, is
        not one of the same experiment.
    closed, nearly_closed : float
        Of a small gap, the share of its height above the noise floor that an effect which leaves nothing
        significant may leave: `closed`, or `nearly_closed` where the 90 % interval reaches `closed`.
    unseen : float
        A remainder below it no camera sees.
    body_m : float
        The body's length.
    """

    detected: float = 0.05
    left_share: float = 0.12
    left: float = 0.0034
    small: float = 0.0017
    small_share: float = 0.35
    speed_share: float = 0.02
    part_share: float = 0.35
    part_effects: int = 2
    part_lead: float = 0.3
    part_change: float = 0.25
    negligible: float = 0.0017
    negligible_speed: float = 0.01
    off: float = 0.0085
    off_times: float = 5.0
    closed: float = 0.25
    nearly_closed: float = 0.5
    unseen: float = 2e-5 / 0.236
    body_m: float = 0.236

    def of_body(self, length_m: float) -> AdequacySettings:
        """Return the rule for a robot of that length."""
        return replace(self, body_m=length_m)

    @property
    def left_m(self) -> float:
        """Most that a named set may leave, metres."""
        return self.left * self.body_m

    @property
    def small_m(self) -> float:
        """Remainder that cameras and simulations leave, metres."""
        return self.small * self.body_m

    @property
    def negligible_m(self) -> float:
        """Gap that does not matter, metres."""
        return self.negligible * self.body_m

    @property
    def off_m(self) -> float:
        """Least by which a trial is of another experiment, metres."""
        return self.off * self.body_m


@dataclass(frozen=True)
class DescriptionSettings:
    """What a description must do to be given.

    Attributes
    ----------
    closed_share : float
        Share of the gap on sealed trials.
    rival_share : float
        Share of what the next best explanation leaves (the best listed effects, or a term that acts on
        something else or elsewhere) that this one may leave at most.
    refits : int
        Terms that are fitted, the best of the screens.
    exchanges : int
        Rounds of looking for a better term from where the best one stands.
    promising_share : float
        Share of what the best of a screen promises from which on a term can be the better one. Twice as much
        would leave out terms of which derivatives far from the fit say little.
    most_bench_sd : float
        Standard deviations that a calibrated value may lie from its bench value; twice what it may with a
        named effect, because a term is only an approximation of what is there.
    explained_share : float
        Share of the misfit that the best may leave and need not be exchanged.
    told_deviance : float
        Deviance, on all open trials, by which another explanation is told from one that leaves nothing
        significant, however little it leaves itself: a few times what chance makes of look-alikes.
    """

    closed_share: float = 0.75
    rival_share: float = 0.5
    refits: int = 7
    exchanges: int = 3
    promising_share: float = 0.1
    most_bench_sd: float = 7.0
    explained_share: float = 0.02
    told_deviance: float = 20.0


ADEQUACY = AdequacySettings()
DESCRIPTION = DescriptionSettings()

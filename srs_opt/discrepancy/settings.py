"""When an explanation is believed: the figures that a laboratory judges by, all on sealed trials."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """The rule of adequacy.

    With enough data every model is rejected: the statistics only say whether something is left. Whether it
    counts is judged by its size.

    Attributes
    ----------
    detected : float
        Level at which calibration alone is rejected.
    left_share, left_m : float
        What a named set of effects may leave where what is left is significant: share of the gap (root mean
        squares beyond the noise), and metres. Simulations and cameras leave 0.2 to 0.4 mm whatever the gap;
        wrong sets close up to 93 % of a large gap and leave millimetres.
    small_m, small_share : float
        A remainder of this size is what cameras and simulations leave: it does not count against a name as
        long as it is no larger share of the gap than `small_share`.
    speed_share : float
        Error of the predicted speed that a named set may leave.
    part_share : float
        Share of the gap that effects may leave which are named as a part of what is missing.
    part_effects : int
        How many effects may be named as a part: three can soak up most of anything.
    part_lead : float
        Share of the gap by which every set without such an effect must leave more.
    part_change : float
        By how much of itself the size of such an effect may change when a third of the trials is left out.
    negligible_m, negligible_speed : float
        A gap below both is none that matters, where no effect explains it.
    off_m : float
        Root mean square from which on a single sealed trial, beyond `off_times` what the others leave, is
        not one of the same experiment.
    closed, nearly_closed : float
        Of a small gap, the share of its height above the noise floor that an effect which leaves nothing
        significant may leave: `closed`, or `nearly_closed` where the 90 % interval reaches `closed`.
    """

    detected: float = 0.05
    left_share: float = 0.12
    left_m: float = 8e-4
    small_m: float = 4e-4
    small_share: float = 0.35
    speed_share: float = 0.02
    part_share: float = 0.35
    part_effects: int = 2
    part_lead: float = 0.3
    part_change: float = 0.25
    negligible_m: float = 4e-4
    negligible_speed: float = 0.01
    off_m: float = 2e-3
    off_times: float = 5.0
    closed: float = 0.25
    nearly_closed: float = 0.5


SETTINGS = Settings()

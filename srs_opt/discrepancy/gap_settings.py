"""What the tests of a gap decide by, what an experiment is designed for, and how gaps are measured."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DetectionSettings:
    """The tests of what a fit leaves.

    Attributes
    ----------
    draws : int
        Of the parametric bootstrap: a p-value of 0.01 is then known to 16 %.
    least_eigenvalue : float
        Of the correlation of a group's columns, over the largest: directions below it are rounding, not
        freedom.
    group_level, serial_level : float
        Shares of the level for the groups of residual functions and candidates, and for the autocorrelation,
        which sees little more. They sum to 1, or the level is not held.
    adequate_level : float
        At which a fitted model is rejected.
    place_level : float
        Family-adjusted, at which a part of the motion is named as one in which something is left.
    name_level : float
        Family-wise, for adding an effect: by chance once in 500 sets.
    """

    draws: int = 4000
    least_eigenvalue: float = 1e-7
    group_level: float = 0.9
    serial_level: float = 0.1
    adequate_level: float = 0.01
    place_level: float = 0.05
    name_level: float = 0.002


@dataclass(frozen=True)
class ExplanationSettings:
    """When a gap counts as explained, and when a search may go on.

    The smoothing of friction is numerical, not physical, and long data sets resolve the difference. What is
    left of a gap is put down to it while it is this share of the noise's variance and of the gap's, and asks
    for nothing known at a size that matters: gaits near a change of theirs show a thousandth of a wheel's
    toe.

    Attributes
    ----------
    noise_share, gap_share : float
        What smoothing may leave: of the noise's variance, and of the gap's.
    telling_size : float
        Of an effect's typical size, from which it matters.
    promised_share : float
        Share of what is left that an effect must promise to close for a search to go on.
    stage_share : float
        Share of the misfit that a fit must close to say in which stage of the model the gap is.
    """

    noise_share: float = 0.02
    gap_share: float = 0.01
    telling_size: float = 0.1
    promised_share: float = 0.5
    stage_share: float = 0.5


@dataclass(frozen=True)
class PlausibilitySettings:
    """What physics and the bench allow a fit.

    Attributes
    ----------
    least_size, most_size : float
        Sizes over typical that a named effect may have: in company, and at all. Beyond them it stands for
        something else.
    most_bench_sd : float
        Standard deviations that a calibrated value may lie from its bench value; by chance once in 2000
        values.
    """

    least_size: float = 0.15
    most_size: float = 4.0
    most_bench_sd: float = 3.5


@dataclass(frozen=True)
class SealSettings:
    """How the gap on sealed trials is measured.

    Attributes
    ----------
    block_s : float
        Blocks that are resampled for the interval. Shorter than the misfit is correlated, the interval is too
        narrow; longer, there are too few blocks.
    draws : int
        Of that resampling.
    correlation_s : float
        Misfit lasts longer than this, noise not a single frame.
    measurable_share : float
        Of the noise floor, that a gap must stand above it for a share of it to mean something.
    least_step_body : float
        Advance per cycle, in body lengths, from which a share of the speed means something.
    least_turn_rad : float
        Turn within the trial from which a radius means something.
    """

    block_s: float = 0.5
    draws: int = 2000
    correlation_s: float = 1 / 60
    measurable_share: float = 0.02
    least_step_body: float = 0.005 / 0.236
    least_turn_rad: float = 0.2


@dataclass(frozen=True)
class VisibleSettings:
    """What the data would have shown.

    Attributes
    ----------
    detected_sd : float
        Standard deviations above the level of detection at which an effect is found nine times in ten.
    trials : int
        On which the effects are played: each costs a simulation per effect.
    """

    detected_sd: float = 1.28
    trials: int = 2


@dataclass(frozen=True)
class DesignSettings:
    """Which experiment is proposed to tell rivals apart.

    Attributes
    ----------
    decisive_deviance : float
        That tells two hypotheses apart; its probability is the power that is reported.
    sure_power : float
        From which on an effect's own instrument is asked before further trials.
    duration_s, rate_hz : float
        Of a proposed trial.
    cycles : int
        That it lasts at least, with a slow gait.
    least_frequency_hz : float
        For sets in which nothing moves.
    long_wave_share : float
        Phase lag of a proposed long wave, over the set's own.
    """

    decisive_deviance: float = 10.0
    sure_power: float = 0.95
    duration_s: float = 4.0
    rate_hz: float = 60.0
    cycles: int = 4
    least_frequency_hz: float = 1e-3
    long_wave_share: float = 0.6


@dataclass(frozen=True)
class FirstExperimentSettings:
    """What to record first: a set like this finds three quarters of the effects.

    Attributes
    ----------
    trials : int
        The set's own gaits, or three frequencies with three offsets.
    duration_s : float
        Of a trial, at least.
    cycles : int
        Of a trial, at least.
    rate_hz : float
        Of the camera.
    frequency_shares : tuple of float
        Of the middle frequency, where the set has too few gaits of its own.
    offsets : tuple of float
        Turning gaits on both sides, and a straight one.
    pressure_shares : tuple of float
        Of the largest pressure.
    fallback_frequency_hz, fallback_pressure_kpa : float
        Where the set holds no gait at all.
    shown_power : float
        From which an effect counts as shown.
    """

    trials: int = 9
    duration_s: float = 3.0
    cycles: int = 3
    rate_hz: float = 60.0
    frequency_shares: tuple[float, ...] = (0.75, 1.0, 1.25)
    offsets: tuple[float, ...] = (-0.3, 0.0, 0.3)
    pressure_shares: tuple[float, ...] = (0.8, 0.9, 1.0)
    fallback_frequency_hz: float = 1.0
    fallback_pressure_kpa: float = 48.0
    shown_power: float = 0.9


@dataclass(frozen=True)
class PayoffSettings:
    """Effort for showing what a name is worth.

    Attributes
    ----------
    starts : int
        Of each of the two optimizations of a gait.
    """

    starts: int = 2


DETECTION = DetectionSettings()
EXPLANATION = ExplanationSettings()
PLAUSIBILITY = PlausibilitySettings()
SEAL = SealSettings()
VISIBLE = VisibleSettings()
DESIGN = DesignSettings()
FIRST = FirstExperimentSettings()
PAYOFF = PayoffSettings()

"""Which data a fit uses, and what it takes for noise."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CleaningSettings:
    """Outlying positions.

    Attributes
    ----------
    reach_s : float
        To either side of a frame, over which a motion is a parabola: 5 % of a cycle at 1.5 Hz.
    least_frames, most_frames : int
        To either side.
    outlier_sd : float
        Robust deviations of a position from the parabola through its neighbours beyond which it is left out:
        by chance one in a million. Half as many would leave out one good position in a hundred and bias the
        noise.
    neighbourhood : int
        Times that reach, over which the usual deviation is taken: an outlier spoils a fifth of it.
    passes : int
        A marker that is elsewhere for several frames spoils its neighbours' parabolas.
    """

    reach_s: float = 0.034
    least_frames: int = 2
    most_frames: int = 5
    outlier_sd: float = 5.0
    neighbourhood: int = 5
    passes: int = 12


@dataclass(frozen=True)
class WhiteNoiseSettings:
    """White noise from the tracks.

    Attributes
    ----------
    least_differences : int
        That an estimate needs.
    jump_sd : float
        Robust standard deviations beyond which a difference is a jump, not noise.
    """

    least_differences: int = 50
    jump_sd: float = 5.0


@dataclass(frozen=True)
class ColouredNoiseSettings:
    """The part of the noise that is correlated in time.

    Attributes
    ----------
    harmonics : int
        Of the gait, free in every distance between neighbours.
    times_s : tuple of float
        Correlation times from which it is looked for,
    shares : tuple of float
        and variances of the correlated part over the white one's.
    first_steps : tuple
        Of the search for the maximum, in the logarithms of both deviations and of the time.
    detected_deviance : float
        Drop from which on noise counts as correlated: by chance once in some thousand sets.
    most_white_growth : float
        Times the white noise that the tracks show. More is a body that moves otherwise than the model: white
        noise known from the tracks does not grow.
    most_correlated : float
        Times the white noise, or `most_correlated_m`: no camera is off by more.
    most_correlated_m : float
        See `most_correlated`.
    """

    harmonics: int = 4
    times_s: tuple[float, ...] = (0.05, 0.2, 0.8)
    shares: tuple[float, ...] = (0.02, 0.15)
    first_steps: tuple[float, float, float] = (0.03, 0.4, 0.8)
    detected_deviance: float = 12.0
    most_white_growth: float = 1.3
    most_correlated: float = 2.0
    most_correlated_m: float = 1e-3


@dataclass(frozen=True)
class SmoothErrorSettings:
    """Drift, and errors that repeat with the gait.

    Attributes
    ----------
    drifts_m : tuple of float
        That are tried. The largest is what still counts as an error of the camera's and not as a discovery:
        twice as much would hide effects at a third of their typical size, half as much would call a camera's
        usual drift a gap.
    systematic_m : tuple of float
        The same for errors that repeat with the gait.
    detected_deviance : float
        Drop from which on they are believed: by chance once in a hundred sets, and then they cost little;
        with twice as much, drift of half the noise stayed behind when a small effect was found.
    free_sizes : float
        Times its typical size: how far an effect is free to go before something counts as noise.
    most_left_sd : float
        Deviations of the misfit's sum that may be left when they are believed.
    shapes : int
        Orders of the errors that repeat with the gait, along the body,
    harmonics : int
        and multiples of the gait's frequency.
    """

    drifts_m: tuple[float, ...] = (0.0, 1e-4, 2e-4, 4e-4, 8e-4, 1.5e-3)
    systematic_m: tuple[float, ...] = (0.0, 2e-5, 4e-5, 8e-5, 1.5e-4, 3e-4)
    detected_deviance: float = 6.0
    free_sizes: float = 3.0
    most_left_sd: float = 4.0
    shapes: int = 4
    harmonics: int = 2


@dataclass(frozen=True)
class EntrySettings:
    """Whether a track shows the gait that its entry says.

    Attributes
    ----------
    least_markers : int
        That tell how the wave runs.
    least_cycles : float
        In the track.
    frequencies_hz : tuple
        Between which the swing is looked for.
    most_off_share : float
        By which the frequency may be off; a valve clock is off by a thousandth.
    least_power_share : float
        Of the swing's power at the best frequency, that the entered one must show. A wrong one shows 0.05 and
        less; the first two cycles, from rest, smear the right one to 0.9.
    most_off_phase_rad : float
        Of the lag between neighbouring joints; slow valves and bent segments make 0.3.
    least_frames : int
        In the track.
    resolution : float
        Cycles over the track, by which a frequency that is read off it may be off.
    even_rad : float
        How well the joints' lags must agree to mean anything.
    """

    least_markers: int = 4
    least_cycles: float = 2.0
    frequencies_hz: tuple[float, float] = (0.15, 8.0)
    most_off_share: float = 0.08
    least_power_share: float = 0.3
    most_off_phase_rad: float = 1.0
    least_frames: int = 40
    resolution: float = 0.6
    even_rad: float = 0.5


@dataclass(frozen=True)
class UsableTrialSettings:
    """Which trials a fit can use.

    Attributes
    ----------
    least_frames : int
        Of a track.
    least_seen_share : float
        Of its positions.
    most_wrong_share : float
        Of the trials that may be entered wrongly: where more are, it is not the entries.
    """

    least_frames: int = 20
    least_seen_share: float = 0.3
    most_wrong_share: float = 0.34


@dataclass(frozen=True)
class OutlyingTrialSettings:
    """Which trials contradict all others.

    Attributes
    ----------
    least_left : int
        Trials that must agree with each other.
    apart_ratio : float
        Misfit beyond the noise of a trial that a fit did not see, over that of the worst trial that it saw,
        from which on the trial is set aside. What a model lacks shows in several trials: a gait that the
        others do not predict is three times worse than they are; a wrong entry or another robot, twenty times
        and more.
    notable_misfit : float
        Of the noise's variance: misfit that is worth a refit.
    most_scatter_sd : float
        Of a trial that a fit did not see: its own friction and curvature go no further.
    worst_ratio : float
        Times the usual misfit that a trial must have in the fit to all, to be left out as a test.
    most_share : float
        Of all trials that may be set aside: with more the others are hardly the usual ones, and each costs
        a fit; one trial always may.
    scatter_rounds : int
        Gauss-Newton steps at most to the scatter of a trial that a fit did not see, each a linearisation.
    settled_sd : float
        Step of it, over its deviation, at which that ends. Smaller: a round more; larger: misfit that belongs
        to the scatter counts against the trial.
    """

    least_left: int = 3
    apart_ratio: float = 8.0
    notable_misfit: float = 0.5
    most_scatter_sd: float = 4.0
    worst_ratio: float = 3.0
    most_share: float = 0.25
    scatter_rounds: int = 3
    settled_sd: float = 0.05


@dataclass(frozen=True)
class AlignmentSettings:
    """Pose and clock of trials that begin in mid-gait.

    Attributes
    ----------
    rounds : int
        Of fitting the clock, at most.
    settled_s : float
        Change of the clock at which that has ended.
    difference_s : float
        For the velocity of the points; its error shrinks with the residual.
    """

    rounds: int = 8
    settled_s: float = 1e-7
    difference_s: float = 1e-3


@dataclass(frozen=True)
class MapDataSettings:
    """Calibration from maps alone. Lengths in body lengths.

    Attributes
    ----------
    least_speed_sd, least_curvature_sd : float
        Of one run beyond the scatter of friction: body lengths per second, and per body length.
    straight_curvature_sd : float
        Of the path's curvature where a map only says "straight", per body length: radii beyond 42 lengths.
    track_s : float
        Length of the tracks that maps are compared with.
    tracks : int
        Simulated for that, at most.
    """

    least_speed_sd: float = 1e-4 / 0.236
    least_curvature_sd: float = 0.01 * 0.236
    straight_curvature_sd: float = 0.06 * 0.236
    track_s: float = 8.0
    tracks: int = 12


CLEANING = CleaningSettings()
WHITE_NOISE = WhiteNoiseSettings()
COLOURED_NOISE = ColouredNoiseSettings()
SMOOTH_ERRORS = SmoothErrorSettings()
ENTRY = EntrySettings()
USABLE = UsableTrialSettings()
OUTLYING_TRIAL = OutlyingTrialSettings()
ALIGNMENT = AlignmentSettings()
MAP_DATA = MapDataSettings()

"""How recordings become trials: start of the valves, labels, frequency, direction, and what is plausible."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class OnsetSettings:
    """When the valves started.

    Attributes
    ----------
    threshold_sd : float
        Noise deviations beyond which a coordinate has left its rest, three frames in a row. Half: noise
        counts as motion now and then; double: the first motion is seen later.
    quiet_frames : int
        At the beginning, whose median is the rest. A take that moves within them began in mid-gait.
    cycles : float
        That are fitted after the first motion.
    most_left : float
        Share of the shapes' change that the fit may leave and still be the motion that was asked for: from
        0.2 a wrong phase lag passes, at 0.5 a robot whose segments differ is refused.
    drift_sd : float
        Standard deviations of chi squared by which a trend at rest must stand out; rest on a shaking table
        stays below.
    phases : int
        Tried per cycle, of a take that begins in mid-gait.
    grid : int
        Starts that are tried between the first and the last possible one.
    factor_range : tuple
        Of C0 and of the time constants against the robot file.
    """

    threshold_sd: float = 6.0
    quiet_frames: int = 5
    cycles: float = 2.0
    most_left: float = 0.35
    drift_sd: float = 8.0
    phases: int = 24
    grid: int = 25
    factor_range: tuple[float, float] = (0.3, 3.0)


@dataclass(frozen=True)
class RunInSettings:
    """How many cycles a robot had behind it when the recording began.

    Attributes
    ----------
    least_s : float
        After which the motion no longer depends on how it began,
    least_run_in_cycles : int
        and after so many cycles.
    least_cycles : int
        In the recording: half of them are compared with the others.
    seen_cycles : int
        That are compared at most; later ones are all alike.
    model_share : float
        By how much of what a cycle lacks a model may be wrong: half of it is what 30 % of friction change.
    least_sd : float
        Of a cycle's share of the settled way; settled cycles of a simulated robot differ by a quarter of
        that.
    evidence : float
        Of twice the log likelihood, before a start later than that of a whole run-in is believed.
    switch_s : float
        To which the switches of a valve wave are found; a camera sees 1/100 s.
    """

    least_s: float = 1.5
    least_run_in_cycles: int = 3
    least_cycles: int = 4
    seen_cycles: int = 12
    model_share: float = 0.5
    least_sd: float = 0.002
    evidence: float = 9.0
    switch_s: float = 2e-4


@dataclass(frozen=True)
class FrequencySettings:
    """The frequency at which the bends repeat.

    Attributes
    ----------
    harmonics : int
        Of the fitted wave.
    searched_share : float
        Of the nominal frequency, on either side: valve clocks are off by a thousandth.
    least_cycles : float
        In the recording.
    significant_sd : float
        Standard deviations from the nominal frequency at which it is another one,
    least_phase : float
        and cycles over the whole take: less phase error is below what the tracks can show.
    most_left : float
        Share of the bends' variance that the best frequency may leave.
    far_left : float
        The same for a frequency far from the nominal one, which a person is asked about.
    """

    harmonics: int = 3
    searched_share: float = 0.03
    least_cycles: float = 4.0
    significant_sd: float = 4.0
    least_phase: float = 0.01
    most_left: float = 0.5
    far_left: float = 0.2


@dataclass(frozen=True)
class DirectionSettings:
    """Which end of a chain of markers is the head.

    Attributes
    ----------
    least_lag : float
        Of the sine of the phase lag: phases of the bends that differ by less in the mean do not tell.
    least_cycles : float
        That every bend must show.
    most_left : float
        Share of the bends' variance that the first harmonic may leave; higher harmonics and noise are in it.
    """

    least_lag: float = 0.3
    least_cycles: float = 1.5
    most_left: float = 0.6


@dataclass(frozen=True)
class LabelSettings:
    """Which position belongs to which link.

    Attributes
    ----------
    near_pitch : float
        Pitches from its prediction, beyond which a position is not this link's: half a pitch is the middle
        between two links.
    farthest_pitch : float
        The same for a link that was lost for long.
    lost_frames : int
        Without any position, after which the chain is looked for anew.
    slack : float
        Neighbours may not be farther apart than this many of their distances when straight.
    chain_tolerance : float
        Of the distance of two markers when the chain is looked for: a bent segment shortens it.
    uneven_share : float
        Of the mean spacing: spacings that differ by more end to end tell which end is the tail.
    most_paths : int
        That are looked at for the best chain, where there are many ghosts; more take longer.
    most_turn_rad : float
        At a marker: a segment does not bend by more than about a right angle.
    turn_cost_1_rad : float
        Of a row's turns, beside the relative misfits of its spacings. Smaller: of rows that are spaced alike
        a crooked one may win; larger: a straight row of ghosts beats a bent robot.
    """

    near_pitch: float = 0.45
    farthest_pitch: float = 0.9
    lost_frames: int = 3
    slack: float = 1.2
    chain_tolerance: float = 0.25
    uneven_share: float = 0.15
    most_paths: int = 200_000
    most_turn_rad: float = 1.6
    turn_cost_1_rad: float = 0.05


@dataclass(frozen=True)
class StepTakeSettings:
    """Step tests from recordings.

    Attributes
    ----------
    rest_frames : int
        Of rest that there are at least.
    risen_share : float
        Of the change, by which the curvature has begun to rise.
    alone_share : float
        Of the largest change: what another segment may bend without the test being doubtful.
    least_frames : int
        That show (nearly) all markers.
    """

    rest_frames: int = 3
    risen_share: float = 0.2
    alone_share: float = 0.5
    least_frames: int = 8


@dataclass(frozen=True)
class ImportSettings:
    """Cutting trials out of takes.

    Attributes
    ----------
    before_step_s : float
        That are kept before the first motion of a step.
    settled_s : float
        After the first motion, from which on the bends repeat from cycle to cycle within their noise.
    same_rate_share : float
        Rates found from rounded times differ by less.
    most_bent_rad : float
        Between neighbouring chords at the start, without a warning; wheels stick, so a few degrees stay at
        rest.
    snap_deg : float
        From one of the camera system's axes, within which the normal of the ground is that axis.
    """

    before_step_s: float = 0.3
    settled_s: float = 0.6
    same_rate_share: float = 1e-3
    most_bent_rad: float = 0.15
    snap_deg: float = 5.0


@dataclass(frozen=True)
class TrackCheckSettings:
    """What is plausible in a track.

    Attributes
    ----------
    most_missing_rows : int
        That are only warned of; more need rows with empty cells.
    farthest_m : float
        From the origin; a fit to 1e308 m ends in not-a-number, not in an answer.
    top_speed_body : float
        Body lengths per second: more can only be another unit.
    most_lost_share : float
        Of the marker positions, without a warning.
    rate_share : float
        By which the time between samples may differ from the stated rate's.
    spacing : tuple
        Distance of neighbouring markers over that of the straight robot: a bent segment shortens it, another
        unit or another order of the markers is beyond.
    most_off_start_rad : float
        Between the heading at the start and the entered one, without a warning.
    most_off_duration : float
        Share by which a track's length may differ from the entered duration and still only be warned of.
    odd_noise, impossible_noise : float
        Factors, up or down, between the noise that a track shows and the stated one, from which on it is
        warned of, and refused.
    least_differences : int
        From which on the noise that a track shows is compared with what is stated.
    """

    most_missing_rows: int = 5
    farthest_m: float = 1e5
    top_speed_body: float = 25.0
    most_lost_share: float = 0.2
    rate_share: float = 0.02
    spacing: tuple[float, float] = (0.6, 1.5)
    most_off_start_rad: float = 0.2
    most_off_duration: float = 0.2
    odd_noise: float = 5.0
    impossible_noise: float = 200.0
    least_differences: int = 100


ONSET = OnsetSettings()
RUN_IN = RunInSettings()
FREQUENCY = FrequencySettings()
DIRECTION = DirectionSettings()
LABELS = LabelSettings()
STEP_TAKE = StepTakeSettings()
IMPORT = ImportSettings()
TRACK_CHECK = TrackCheckSettings()

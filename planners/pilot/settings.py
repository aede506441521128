"""What a piloted drive decides by: when it vents, when it orders a cycle, how far it trusts the camera."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PilotSettings:
    """The drive. Lengths in body lengths.

    Attributes
    ----------
    poll_s : float
        Between two looks at line and camera.
    check_s : float
        Between two checks of the motion against the walls.
    least_lead_s : float
        Before a cycle's end, at which the next is decided; the line's and the driver's own time are added.
    most_lead : float
        Share of a cycle that this takes at most: with less of it seen, its end cannot be predicted.
    longest_decision_s : float
        Time of a decision that the first cycle is prepared for; later ones go by what was seen.
    pose_lost_s : float
        Without a pose for so long the robot halts: three times the longest gap of a camera that loses every
        marker for a few frames.
    remembered_s : float
        Of sightings: longer than any cycle.
    stray : float
        Distance from the predicted motion at which the robot vents: it was lifted, pushed, or does not
        move.
    contact : float
        Foreseen clearance at which it is better to vent than to go on. Below zero, since the prediction
        errs.
    rest_s, rest : float
        Places of so long within so much: the robot stands still.
    longest_coast_s : float
        That it is given to come to rest.
    begin_s : float
        After an accepted cycle has not begun: longer than any cycle and any settling.
    first_pose_s : float
        After which a camera that sends nothing is reported.
    least_sightings : int
        Of a cycle, below which the motion is not judged.
    at_start, at_start_rad : float
        Distance and angle from the maze's start beyond which nothing is begun.
    """

    poll_s: float = 0.004
    check_s: float = 0.04
    least_lead_s: float = 0.04
    most_lead: float = 0.6
    longest_decision_s: float = 0.1
    pose_lost_s: float = 0.25
    remembered_s: float = 3.0
    stray: float = 0.339
    contact: float = -0.00847
    rest_s: float = 0.3
    rest: float = 0.03388
    longest_coast_s: float = 4.0
    begin_s: float = 5.0
    first_pose_s: float = 2.0
    least_sightings: int = 3
    at_start: float = 0.127
    at_start_rad: float = 0.15


@dataclass(frozen=True)
class ObserverSettings:
    """Standard deviations with which a cycle's prediction is corrected by the camera.

    Attributes
    ----------
    marker_m : float
        Noise of a marker, with what the model lacks.
    pose : (x m, y m, heading rad)
        Noise of a pose, likewise.
    offset : (x m, y m, heading rad)
        The last cycle's error, kept wide so that the camera always wins.
    drift : (x m/s, y m/s, heading rad/s)
        20 % of the speed of a fast gait. Half of it ignores a hose for several cycles; double makes noise
        into speed.
    latency_s : float
        Before the first cycle.
    latency_change_s : float
        That the latency may change by from cycle to cycle.
    longest_latency_s : float
        Bound on its estimate.
    clock_stamps : int
        Stamps from which the sender's clock is estimated: half a minute at 100 Hz, long against jitter,
        short against the drift of clocks.
    recorded_marker_m : float
        Written into the data set of a drive until its noise is measured.
    """

    marker_m: float = 0.002
    pose: tuple[float, float, float] = (0.0015, 0.0015, 0.01)
    offset: tuple[float, float, float] = (0.05, 0.05, 0.3)
    drift: tuple[float, float, float] = (0.1, 0.1, 0.3)
    latency_s: float = 0.05
    latency_change_s: float = 0.001
    longest_latency_s: float = 0.3
    clock_stamps: int = 3000
    recorded_marker_m: float = 0.001


@dataclass(frozen=True)
class ValveLineSettings:
    """The line to the controller.

    Attributes
    ----------
    answer_s : float
        Until a command is sent again. A frame takes 3 ms at 115,200 baud; the rest is for adapters and
        radios that hold bytes back. Shorter repeats needlessly, longer loses time in a cycle of half a
        second.
    most_tries : int
        In all less than the controller's timeout of 0.5 s.
    keep_alive_s : float
        A fifth of the controller's timeout.
    """

    answer_s: float = 0.08
    most_tries: int = 5
    keep_alive_s: float = 0.1


PILOT = PilotSettings()
OBSERVER = ObserverSettings()
VALVE_LINE = ValveLineSettings()

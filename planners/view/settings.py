"""How finely plans and drives are shown."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ViewSettings:
    """Pictures, animations and recordings.

    Attributes
    ----------
    body_step_s : float
        Between the bodies whose union is the swept region in a picture. Half takes twice the time.
    shown_clearance_m : float
        Clearance above which pictures and recordings do not tell how much.
    least_labelled : float
        Body lengths of way with one gait: numbers nearer to each other would overlap.
    frames_per_s, most_frames : int
        Of an animation; a longer one is thinned.
    recorded_frame_s : float
        Between the frames of a recording.
    most_recorded_frames : int
        A longer one is thinned.
    hold_s : float
        That an animation's last picture stays.
    """

    body_step_s: float = 0.04
    shown_clearance_m: float = 0.1
    least_labelled: float = 0.4
    frames_per_s: int = 20
    most_frames: int = 600
    recorded_frame_s: float = 1 / 30
    most_recorded_frames: int = 6000
    hold_s: float = 1.5


VIEW = ViewSettings()

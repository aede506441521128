"""Which trials a fit can use, and why not the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from srs_opt.calibrate.data_settings import USABLE
from srs_opt.calibrate.entries import contradicted
from srs_opt.calibrate.noise import track_of
from srs_opt.measurement.records import Trial

_PASSIVE = ("tow", "push")  # somebody's hand moves the robot: not simulated


def rejection_reason(trial: Trial) -> str:
    """Return why a trial cannot be used; empty when it can."""
    track = track_of(trial)
    if trial.kind in _PASSIVE:
        return f"kind '{trial.kind}' is not driven by the valves"
    if track is None or track.shape[0] < USABLE.least_frames:
        return "too few frames"
    seen = float(np.isfinite(track).mean())
    if seen < USABLE.least_seen_share:
        return f"only {seen:.0%} of the markers were seen"
    if not np.all(np.diff(trial.time_s) > 0):
        return "its clock does not run forward"
    return ""


def left_out(trials: Sequence[Trial]) -> dict[str, str]:
    """Return the trials that cannot be used, or whose own tracks contradict what is entered, and why.

    Where most tracks contradict their entries, it is not the entries: markers are counted from the head, say.
    """
    found = {t.name: why for t in trials if (why := rejection_reason(t))}
    rest = [t for t in trials if t.name not in found]
    wrong = {t.name: why for t in rest if (why := contradicted(t))}
    return found | wrong if len(wrong) <= USABLE.most_wrong_share * len(rest) else found

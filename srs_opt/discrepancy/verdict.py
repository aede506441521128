"""Step 9: what may be said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from srs_opt.discrepancy.examined import ADEQUATE, Examined, explained
from srs_opt.discrepancy.seal import Gap
from srs_opt.discrepancy.select import Selection

DETECTED = 0.05
NO_GAP, NAMED, ONE_OF, UNKNOWN, NOT_TESTABLE = "no_gap", "named", "one_of", "unknown", "not_testable"
NAMED_IN_PART, DESCRIBED = "named_in_part", "described"


@dataclass(frozen=True)
class Verdict:
    """The word, and the sentence that says why."""

    word: str
    why: str


def judge(
    null: Examined,
    best: Examined,
    selection: Selection | None,
    gap: Gap | None,
    at_odds: Sequence[str] = (),
    *,
    restricted: bool = False,
) -> Verdict:
    """Return the verdict; every doubt counts against a name.

    Parameters
    ----------
    at_odds : sequence of str
        Trials without which calibration alone explains the others.
    restricted : bool
        Whether only some effects were considered: then what these leave is expected, and does not count
        against those that close a part of the gap on sealed trials.
    """
    p = null.detection.p_value
    if p >= DETECTED:
        return Verdict(
            NO_GAP, f"calibration alone explains the data (p = {p:.2g}); nothing is missing that they show"
        )
    if at_odds:
        who = (
            f"trial {at_odds[0]} contradicts"
            if len(at_odds) == 1
            else f"trials {', '.join(at_odds)} contradict"
        )
        return Verdict(UNKNOWN, f"{who} the others, which calibration alone explains: look there first")
    if selection is None or not selection.best.candidates:
        return Verdict(UNKNOWN, f"there is a gap (p = {p:.2g}), but no known effect explains it")
    label = " + ".join(selection.best.names)
    # what the effects that were not considered do, calibration bends the bench values for
    in_part = restricted and gap is not None and gap.closed_in_part
    in_part = in_part and not selection.best.implausible_size()
    if not explained(null, best):
        left = best.detection.p_value
        if in_part:
            return _in_part(label, f"p of the rest = {left:.2g}")
        return Verdict(
            UNKNOWN,
            f"the best known explanation ({label}) leaves a gap (p = {left:.2g}, limit {ADEQUATE:g}): "
            "something else is at work",
        )
    against = selection.best.implausible()
    if against:
        if in_part:
            return _in_part(label, against)
        return Verdict(UNKNOWN, f"the best known explanation ({label}) is not plausible: {against}")
    if gap is not None and gap.ratio is not None and not gap.passed:
        return Verdict(
            UNKNOWN,
            f"{label} fits the open trials but closes only {1 - gap.ratio:.0%} of the gap on the sealed ones",
        )
    if selection.rivals:
        names = " or ".join(" + ".join(h.names) for h in (selection.best, *selection.rivals))
        return Verdict(ONE_OF, f"the data cannot tell between {names}")
    return Verdict(NAMED, f"{label} explains the gap, and nothing else known does")


def _in_part(label: str, rest: str) -> Verdict:
    return Verdict(
        NAMED_IN_PART,
        f"{label} explains a part of the gap ({rest}); the rest is none of the effects that were considered: "
        "go on from the corrected robot with all of them",
    )

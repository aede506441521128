"""Step 9: what may be said."""

from __future__ import annotations

from dataclasses import dataclass

from srs_opt.discrepancy.diagnostics import Diagnostics, explained
from srs_opt.discrepancy.gap_settings import DETECTION
from srs_opt.discrepancy.locate import left_places
from srs_opt.discrepancy.seal import Gap
from srs_opt.discrepancy.select import Selection
from srs_opt.discrepancy.settings import ADEQUACY, AdequacySettings

NO_GAP, NAMED, ONE_OF, UNKNOWN, NOT_TESTABLE = "no_gap", "named", "one_of", "unknown", "not_testable"
NAMED_IN_PART, DESCRIBED = "named_in_part", "described"
BELIEVED = (NAMED, NAMED_IN_PART, DESCRIBED)


@dataclass(frozen=True)
class Verdict:
    """The word, and the sentence that says why."""

    word: str
    why: str


def judge(
    null: Diagnostics,
    best: Diagnostics,
    selection: Selection | None,
    gap: Gap | None,
    settings: AdequacySettings = ADEQUACY,
    *,
    restricted: bool = False,
) -> Verdict:
    """Return the verdict; every doubt counts against a name.

    Parameters
    ----------
    restricted : bool
        Whether only some effects were considered: then what these leave is expected, and does not count
        against those that close a part of the gap on sealed trials.
    """
    p = null.detection.p_value
    if p >= settings.detected:
        return _no_gap(gap, p, settings)
    if selection is None or not selection.best.candidates:
        if gap is not None and negligible(gap, settings):
            return Verdict(NO_GAP, _small(gap))
        return Verdict(UNKNOWN, f"there is a gap (p = {p:.2g}), but no known effect explains any of it")
    label = " + ".join(selection.best.names)
    doubt = _doubt(null, best, selection, gap, settings)
    if not doubt and selection.rivals:
        names = " or ".join(" + ".join(h.names) for h in (selection.best, *selection.rivals))
        return Verdict(ONE_OF, f"the data cannot tell between {names}")
    if not doubt:
        return Verdict(
            NAMED, f"{label} explains the gap, and nothing else known does{_further(best, gap, settings)}"
        )
    if gap is not None and negligible(gap, settings):
        return Verdict(NO_GAP, f"{_small(gap)}; the best known explanation would be {label}, but {doubt}")
    if gap is not None and _sure_in_part(selection, gap, settings, restricted=restricted):
        return _in_part(label, doubt, gap, restricted=restricted)
    return Verdict(
        UNKNOWN, f"the best known explanation is {label}{_closing(gap)}, not believed because {doubt}"
    )


def negligible(gap: Gap, settings: AdequacySettings = ADEQUACY) -> bool:
    """Whether what calibration alone leaves on the sealed trials is too small to matter."""
    speed = gap.before.speed_share or 0.0
    return gap.before.m <= settings.negligible_m and speed <= settings.negligible_speed


def _no_gap(gap: Gap | None, p: float, settings: AdequacySettings) -> Verdict:
    """Return the verdict where the open trials show nothing: the sealed ones are asked too."""
    if gap is not None and not negligible(gap, settings) and gap.before.m > gap.floor_error_m:
        return Verdict(
            UNKNOWN,
            f"calibration alone explains the open trials (p = {p:.2g}), but misses the sealed ones, which no "
            f"fit saw, by {1e3 * gap.before.m:.2g} mm{_in_speed(gap.before.speed_share)}",
        )
    return Verdict(
        NO_GAP, f"calibration alone explains the data (p = {p:.2g}); nothing is missing that they show"
    )


def _doubt(
    null: Diagnostics, best: Diagnostics, selection: Selection, gap: Gap | None, settings: AdequacySettings
) -> str:
    """Return what counts against the best set of effects; empty when nothing does."""
    against = selection.best.implausible()
    if against:
        return against
    if explained(null, best):
        if gap is None or gap.ratio is None or _closed(gap, settings):
            return ""
        return f"it closes only {1 - gap.ratio:.0%} of the gap on the sealed trials"
    left = f"something is left (p = {best.detection.p_value:.2g}, limit {DETECTION.adequate_level:g})"
    if gap is None or gap.share is None:
        return left
    nearly_all = gap.share <= settings.left_share and gap.after.m <= settings.left_m
    if not nearly_all and not _small_rest(gap, settings):
        return f"{left}, {1e3 * gap.after.m:.2g} mm on the sealed trials or {gap.share:.0%} of the gap"
    if (gap.after.speed_share or 0.0) > settings.speed_share:
        return f"{left}: the speed is {gap.after.speed_share:.1%} off"
    return ""


def _closed(gap: Gap, settings: AdequacySettings) -> bool:
    """Whether a set of effects that leaves nothing significant closes the gap on the sealed trials."""
    if gap.ratio is None or gap.interval is None:
        return False
    if _small_rest(gap, settings):
        return True
    near = gap.interval[0] <= settings.closed and gap.ratio <= settings.nearly_closed
    return gap.ratio <= settings.closed or near


def _small_rest(gap: Gap, settings: AdequacySettings) -> bool:
    return gap.after.m <= settings.small_m and (gap.share or 0.0) <= settings.small_share


def _sure_in_part(selection: Selection, gap: Gap, settings: AdequacySettings, *, restricted: bool) -> bool:
    """Whether every effect of the best set is sure to be a part of what is missing."""
    best = selection.best
    if best.implausible_size() or gap.share is None or selection.rivals:
        return False
    if restricted:
        return gap.closed_in_part
    if best.implausible() or gap.share > settings.part_share:
        return False
    firm = selection.change <= settings.part_change and len(best.candidates) <= settings.part_effects
    return firm and gap.lead is not None and gap.lead >= settings.part_lead


def _in_part(label: str, doubt: str, gap: Gap, *, restricted: bool) -> Verdict:
    rest = (
        "the rest is none of the effects that were considered: go on from the corrected robot with all"
        if restricted
        else "no other set does, in whatever trials; the rest is something else"
    )
    return Verdict(NAMED_IN_PART, f"{label} explains a part of the gap{_closing(gap)} ({doubt}); {rest}")


def _small(gap: Gap) -> str:
    return (
        f"calibration alone predicts the sealed trials within {1e3 * gap.before.m:.2g} mm"
        f"{_in_speed(gap.before.speed_share)}: what is left is significant, but too small to matter"
    )


def _further(best: Diagnostics, gap: Gap | None, settings: AdequacySettings) -> str:
    """Return what is told beside a name: a remainder that is significant."""
    if gap is None or best.adequate or gap.after.m < settings.unseen * settings.body_m:
        return ""
    closes = "" if gap.share is None else f"it closes {max(1 - gap.share, 0.0):.1%} of it, "
    left = f"{1e3 * gap.after.m:.2g} mm{_in_speed(gap.after.speed_share)}"
    places = left_places(best)
    where = f", mostly in {places[0].where}, varying with {places[0].against}" if places else ""
    return f"; {closes}a further {left} is something else{where}"


def _closing(gap: Gap | None) -> str:
    return (
        "" if gap is None or gap.share is None else f", which closes {max(1 - gap.share, 0.0):.0%} of the gap"
    )


def _in_speed(share: float | None) -> str:
    return "" if share is None else f" and {share:.1%} of the speed"

"""Step 1: which trials may be fitted and which stay sealed until the end.

The split follows from the data alone. Whole gaits are sealed, all their replicates with them, so that a gap
that closes is a prediction of gaits that no fit has seen.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from zlib import crc32

import numpy as np

from srs_opt.calibrate.rejection import left_out
from srs_opt.discrepancy.search_settings import SPLIT
from srs_opt.measurement.records import Trial


@dataclass(frozen=True)
class Split:
    """Trials by purpose.

    Attributes
    ----------
    open : tuple of Trial
        Fitted, in folds that predict each other for selection.
    sealed : tuple of Trial
        Looked at once, at the end.
    folds : tuple of tuple of str
        Names of the open trials, by fold; trials of one condition are in one fold.
    left_out : tuple of (str, str)
        Trials that cannot be used, and why.
    new_gaits : bool
        Whether no sealed trial repeats a gait of an open one.
    """

    open: tuple[Trial, ...]
    sealed: tuple[Trial, ...]
    folds: tuple[tuple[str, ...], ...]
    left_out: tuple[tuple[str, str], ...]
    new_gaits: bool = True

    @property
    def enough(self) -> bool:
        """Whether there is anything to test on."""
        return len(self.open) >= SPLIT.least_open and len(self.sealed) >= SPLIT.least_sealed

    def without(self, reasons: Mapping[str, str]) -> Split:
        """Return the split with open trials left out, by name, for a reason."""
        rest = tuple(t for t in self.open if t.name not in reasons)
        folds = tuple(tuple(n for n in fold if n not in reasons) for fold in self.folds)
        return replace(self, open=rest, folds=folds, left_out=(*self.left_out, *reasons.items()))


def split_trials(trials: Sequence[Trial]) -> Split:
    """Seal about a quarter of the trials, whole conditions at a time, and deal the others into folds."""
    reasons = left_out(trials)
    good = [t for t in trials if t.name not in reasons]
    groups = _conditions(good)
    chosen = _chosen(groups, len(good)) if len(good) > SPLIT.least_open else []
    sealed = [t for t in good if any(t in groups[k] for k in chosen)]
    rest = [t for t in good if t not in sealed]
    folds: list[list[str]] = [[] for _ in range(min(SPLIT.folds, len(rest)))]
    for k, group in enumerate(groups[k] for k in range(len(groups)) if k not in chosen):
        if folds:
            folds[k % len(folds)] += [t.name for t in group]
    gaits = {gait_of(t) for t in rest}
    new = not any(gait_of(t) in gaits for t in sealed)
    return Split(tuple(rest), tuple(sealed), tuple(tuple(f) for f in folds if f), tuple(reasons.items()), new)


def gait_of(trial: Trial) -> Hashable:
    """Return what the valves of a trial do: the same for its replicates, in whatever direction they go."""
    wave = trial.frequency_hz, trial.pressure_kpa, trial.offset, trial.phase_lag_rad
    schedule = "" if trial.schedule is None else repr((trial.schedule.period_s, trial.schedule.intervals))
    applied = 0
    if trial.applied is not None:
        drive = trial.applied
        # what was applied tells a drive, whatever the file is called
        applied = crc32(b"".join(a.tobytes() for a in (drive.time_s, drive.state, drive.pressure_kpa)))
    return (trial.kind, schedule, applied, *(round(v, 6) for v in wave))


_KEYS: tuple[Callable[[Trial], Hashable], ...] = (
    gait_of,
    lambda t: (gait_of(t), round(t.heading_rad, 6), t.tether, t.floor or ""),
    lambda t: (gait_of(t), round(t.heading_rad, 6), t.tether, t.floor or "", t.name),
)


def _conditions(trials: Sequence[Trial]) -> list[list[Trial]]:
    """Return the trials by gait, in an order of their own; finer where there are too few."""
    for key in _KEYS:
        groups: dict[Hashable, list[Trial]] = defaultdict(list)
        for t in trials:
            groups[key(t)].append(t)
        # sorted by what they are: the split does not depend on the order of the file
        found = [groups[k] for k in sorted(groups, key=repr)]
        if len(found) > SPLIT.least_open and len(trials) - min(map(len, found)) >= SPLIT.least_open:
            break
    return found


def _chosen(groups: Sequence[Sequence[Trial]], trials: int) -> list[int]:
    """Return which groups to seal: the middle one, then such as share least with those chosen."""
    wanted = max(round(SPLIT.sealed_share * trials), SPLIT.least_sealed)
    order = [k for k in _from_the_middle([g[0] for g in groups]) if groups[k][0].kind != "still"]
    chosen: list[int] = []
    count = 0
    while count < wanted:
        rest = [k for k in order if k not in chosen]
        fits = [k for k in rest if count + len(groups[k]) <= max(wanted, trials // 3, 1)]
        fits = [k for k in fits if trials - count - len(groups[k]) >= SPLIT.least_open]
        if not fits:
            break
        # a gait of many replicates would use up the share and leave fewer gaits to predict
        best = min(
            fits,
            key=lambda k: (len(groups[k]), sum(_shared(groups[k][0], groups[c][0]) for c in chosen)),
        )
        chosen.append(best)
        count += len(groups[best])
    return chosen


def _from_the_middle(trials: Sequence[Trial]) -> list[int]:
    """Return the trials' numbers by distance from the middle of the conditions."""
    table = np.array([(t.frequency_hz, t.pressure_kpa, t.offset, t.phase_lag_rad) for t in trials])
    spread = table.std(axis=0)
    scaled = (table - np.median(table, axis=0)) / np.where(spread > 0, spread, np.inf)
    # rounded, so that ties are ties on every machine; the stable sort then decides by order
    distance = np.round(np.linalg.norm(scaled, axis=1), 6)
    return [int(k) for k in np.argsort(distance, kind="stable")]


def few_and_brief(trials: Sequence[Trial]) -> tuple[Trial, ...]:
    """Return the first seconds of a few trials, spread over the conditions, under names of their own.

    They cost a fraction of the whole, and a motion that has gone on for less long depends on the parameters
    less nonlinearly: a fit that begins with them ends sooner. Nothing where that would save little.
    """
    chosen: list[Trial] = []
    named = sorted(trials, key=lambda t: (repr(gait_of(t)), t.heading_rad, t.name))
    order = [named[k] for k in _from_the_middle(named)] if named else []
    while len(chosen) < min(SPLIT.brief_trials, len(trials)):
        rest = [t for t in order if t not in chosen]
        chosen.append(min(rest, key=lambda t: sum(_shared(t, c) for c in chosen)))
    found = tuple(_first_seconds(t) for t in trials if t in chosen)
    whole, part = (sum(float(t.time_s[-1]) for t in some) for some in (trials, found))
    return found if part < SPLIT.brief_share * whole else ()


def brief_name(name: str) -> str:
    """Return what the first seconds of a trial are called."""
    return f"{name}, first seconds"


def _first_seconds(trial: Trial) -> Trial:
    seen = trial.time_s - trial.time_s[0] <= SPLIT.brief_s
    markers = None if trial.markers_m is None else trial.markers_m[seen]
    centre = None if trial.centre_m is None else trial.centre_m[seen]
    return replace(
        trial, name=brief_name(trial.name), time_s=trial.time_s[seen], markers_m=markers, centre_m=centre
    )


def _shared(a: Trial, b: Trial) -> int:
    keys = ("frequency_hz", "pressure_kpa", "offset", "heading_rad")
    shared: int = sum(getattr(a, k) == getattr(b, k) for k in keys) ** 2
    return shared

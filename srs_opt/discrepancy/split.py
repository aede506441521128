"""Step 1: which trials may be fitted and which stay sealed until the end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from srs_opt.calibrate.usable import usable
from srs_opt.measurement.records import Trial

SEALED_SHARE = 0.25
LEAST_OPEN, LEAST_SEALED = 3, 1
FOLDS = 3
FEW, BRIEF_S = 5, 3.0  # trials, and seconds of each, on which a fit is first tried


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
        Names of the open trials, by fold.
    left_out : tuple of (str, str)
        Trials that cannot be used, and why.
    """

    open: tuple[Trial, ...]
    sealed: tuple[Trial, ...]
    folds: tuple[tuple[str, ...], ...]
    left_out: tuple[tuple[str, str], ...]

    @property
    def enough(self) -> bool:
        """Whether there is anything to test on."""
        return len(self.open) >= LEAST_OPEN and len(self.sealed) >= LEAST_SEALED


def split_trials(trials: Sequence[Trial], seed: int = 0) -> Split:
    """Seal about a quarter of the trials, spread over conditions; deal the others into folds."""
    reasons = [(t.name, usable(t)) for t in trials]
    left_out = tuple((name, why) for name, why in reasons if why)
    names = {name for name, _ in left_out}
    good = [t for t in trials if t.name not in names]
    rng = np.random.default_rng([seed, len(good)])
    sealed = spread(good, max(round(SEALED_SHARE * len(good)), 1) if len(good) > LEAST_OPEN else 0, rng)
    rest = [t for t in good if t not in sealed]
    folds: list[list[str]] = [[] for _ in range(min(FOLDS, len(rest)))]
    for k, t in enumerate(sorted(rest, key=lambda t: (t.offset, t.frequency_hz, t.pressure_kpa))):
        folds[k % len(folds)].append(t.name)
    return Split(tuple(rest), tuple(sealed), tuple(map(tuple, folds)), left_out)


def spread(trials: Sequence[Trial], count: int, rng: np.random.Generator) -> list[Trial]:
    """Choose trials one by one, each from the conditions least chosen so far."""
    chosen: list[Trial] = []
    order = [trials[i] for i in rng.permutation(len(trials))]
    while len(chosen) < count:
        rest = [t for t in order if t not in chosen]
        chosen.append(min(rest, key=lambda t: sum(_shared(t, c) for c in chosen)))
    return chosen


def few_and_brief(trials: Sequence[Trial], seed: int = 0) -> tuple[Trial, ...]:
    """Return the first seconds of a few trials, spread over the conditions, under names of their own.

    They cost a fraction of the whole, and a motion that has gone on for less long depends on the parameters
    less nonlinearly: a fit that begins with them ends sooner. Nothing where that would save little.
    """
    chosen = spread(trials, min(FEW, len(trials)), np.random.default_rng([seed, 29]))
    found = tuple(_first_seconds(t) for t in trials if t in chosen)
    whole, part = (sum(float(t.time_s[-1]) for t in some) for some in (trials, found))
    return found if part < 0.7 * whole else ()


def brief_name(name: str) -> str:
    """Return what the first seconds of a trial are called."""
    return f"{name}, first seconds"


def _first_seconds(trial: Trial) -> Trial:
    seen = trial.time_s - trial.time_s[0] <= BRIEF_S
    markers = None if trial.markers_m is None else trial.markers_m[seen]
    centre = None if trial.centre_m is None else trial.centre_m[seen]
    return replace(
        trial, name=brief_name(trial.name), time_s=trial.time_s[seen], markers_m=markers, centre_m=centre
    )


def _shared(a: Trial, b: Trial) -> int:
    keys = ("frequency_hz", "pressure_kpa", "offset", "heading_rad")
    return sum(getattr(a, k) == getattr(b, k) for k in keys) ** 2

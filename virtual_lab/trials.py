"""What the laboratory runs: trials and balanced designs of trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from virtual_lab.errors import LabError

FREQUENCIES_HZ = (1.0, 1.5, 2.0)
PRESSURES_KPA = (41.0, 48.0, 55.0)
OFFSETS = (-0.4, 0.0, 0.4)
HEADINGS_RAD = (0.0, math.pi / 2, math.pi, -math.pi / 2)


@dataclass(frozen=True)
class Schedule:
    """A segment's own switch times, repeated: S = +1 from `on_s` to `off_s`, else -1.

    A segment that no entry names is vented (S = 0). An interval may wrap around the period's end.
    """

    entries: tuple[tuple[int, float, float], ...]
    period_s: float


@dataclass(frozen=True)
class Trial:
    """One run of the robot; the fields are the columns of trials.csv."""

    name: str
    frequency_hz: float
    pressure_kpa: float
    offset: float = 0.0
    phase_lag_rad: float = math.pi / 2
    heading_rad: float = 0.0
    duration_s: float = 4.0
    schedule: Schedule | None = None
    tether: bool = True
    kind: str = "gait"
    replicate_of: str = ""

    def __post_init__(self) -> None:
        if not self.frequency_hz > 0 or not self.duration_s > 0 or not self.pressure_kpa >= 0:
            raise LabError(
                f"trial '{self.name}': frequency and duration must be above 0, pressure not below; "
                f"found {self.frequency_hz:g} Hz, {self.duration_s:g} s, {self.pressure_kpa:g} kPa"
            )


def small_design(rng: np.random.Generator, duration_s: float = 4.0) -> list[Trial]:
    """Return 12 trials in which every frequency, pressure and offset comes 4 times, every heading 3 times.

    The last three repeat the first three gaits in another heading. Headings are dealt from `rng`.
    """
    trials: list[Trial] = []
    turns = rng.permutation(4)
    for k in range(4):
        for i in range(3):
            trial = Trial(
                name=f"t{len(trials) + 1:02d}",
                frequency_hz=FREQUENCIES_HZ[i],
                pressure_kpa=PRESSURES_KPA[(i + k) % 3],
                offset=OFFSETS[(i + 2 * k) % 3],
                heading_rad=HEADINGS_RAD[turns[(i + k) % 4]],
                duration_s=duration_s,
                replicate_of=f"t{i + 1:02d}" if k == 3 else "",
            )
            trials.append(trial)
    return trials


def large_design(rng: np.random.Generator, duration_s: float = 7.9) -> list[Trial]:
    """Return 33 trials: 3 frequencies x 3 pressures x 3 offsets, and the middle of them twice more.

    Headings are dealt evenly from `rng`.
    """
    gaits = [(f, p, o, "") for f in FREQUENCIES_HZ for p in PRESSURES_KPA for o in OFFSETS]
    middle = gaits.index((1.5, 48.0, -0.4, ""))
    gaits += [(1.5, 48.0, OFFSETS[j // 2], f"t{middle + j // 2 + 1:02d}") for j in range(6)]
    headings = rng.permutation(np.resize(HEADINGS_RAD, len(gaits)))
    return [
        Trial(f"t{n + 1:02d}", f, p, o, heading_rad=float(h), duration_s=duration_s, replicate_of=again)
        for n, ((f, p, o, again), h) in enumerate(zip(gaits, headings))
    ]


def steps_design(links: int, pressure_kpa: float = 48.0, duration_s: float = 2.0) -> list[Trial]:
    """Return one trial per segment in which only that segment bends, left then right."""
    return [
        Trial(
            name=f"s{segment:02d}",
            frequency_hz=1.0 / duration_s,
            pressure_kpa=pressure_kpa,
            duration_s=duration_s,
            schedule=Schedule(((segment, 0.0, 0.5 * duration_s),), duration_s),
            kind="step",
        )
        for segment in range(1, links)
    ]


def design(
    name: str, rng: np.random.Generator, links: int = 5, duration_s: float | None = None
) -> list[Trial]:
    """Return the design called `name`: small, large, or steps.

    Raises
    ------
    LabError
        There is no such design.
    """
    options = {} if duration_s is None else {"duration_s": duration_s}
    if name == "small":
        return small_design(rng, **options)
    if name == "large":
        return large_design(rng, **options)
    if name == "steps":
        return steps_design(links, **options)
    raise LabError(f"no design is called '{name}'; known: small, large, steps")


def without_tether(trials: Sequence[Trial], numbers: Sequence[int]) -> list[Trial]:
    """Return the trials, those at `numbers` (from 0) run without the tether."""
    chosen = set(numbers)
    return [replace(trial, tether=False) if n in chosen else trial for n, trial in enumerate(trials)]

"""Write a measured data set: a folder of trials, the robot file, and what else the laboratory measured."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from virtual_lab.assemble import Factors
from virtual_lab.bench import write_bench
from virtual_lab.camera import centre_picture, label_times, measured, picture
from virtual_lab.disturb import WRONG_ENTRIES, Disturbances, disturbed, mistaken
from virtual_lab.errors import LabError
from virtual_lab.files import whole_folder, write_table, write_text
from virtual_lab.maps import COLUMNS, map_rows
from virtual_lab.trials import Trial
from virtual_lab.truth import Scatter, Truth

_TRIAL_COLUMNS = (
    "trial",
    "frequency_hz",
    "pressure_kpa",
    "offset",
    "phase_lag_rad",
    "heading_rad",
    "duration_s",
)

MAX_RATE_HZ = 1e5


@dataclass(frozen=True)
class Recording(Disturbances):
    """How the laboratory records, and what its camera and notebook add.

    Attributes
    ----------
    rate_hz, marker_sd_m : float
        Camera rate and noise per coordinate.
    stated_sd_m : float or None
        What dataset.yaml claims the noise to be (None: the truth).
    lost : float
        Probability that a marker is lost in a frame.
    markers : {"tail_to_head", "centre_of_mass"}
        All links, or their mass-weighted centre alone.
    bench, maps, tracks : bool
        Whether to write bench/, maps.csv, and trials.csv with trials/.
    replicates : int
        Runs of each gait of maps.csv.
    wrong_entry : {"", "phase_sign", "frequency", "other_robot"}
        What one trial, drawn at random, has wrong: see `mistaken`.
    """

    rate_hz: float = 120.0
    marker_sd_m: float = 0.001
    stated_sd_m: float | None = None
    lost: float = 0.01
    markers: str = "tail_to_head"
    bench: bool = False
    maps: bool = False
    tracks: bool = True
    replicates: int = 3
    wrong_entry: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.wrong_entry and self.wrong_entry not in WRONG_ENTRIES:
            raise LabError(
                f"wrong entry: expected one of {', '.join(WRONG_ENTRIES)}, found '{self.wrong_entry}'"
            )
        if self.markers not in ("tail_to_head", "centre_of_mass"):
            raise LabError(f"markers must be tail_to_head or centre_of_mass, found '{self.markers}'")
        if (
            not self.rate_hz > 0
            or not self.marker_sd_m >= 0
            or not 0 <= self.lost <= 1
            or self.replicates < 1
        ):
            raise LabError(
                "expected rate_hz above 0, marker_sd_m not below 0, lost 0 to 1, replicates from 1; found "
                f"{self.rate_hz:g}, {self.marker_sd_m:g}, {self.lost:g}, {self.replicates}"
            )
        if self.rate_hz > MAX_RATE_HZ:
            raise LabError(f"expected a camera rate of at most {MAX_RATE_HZ:g} Hz, found {self.rate_hz:g}")
        if not (self.tracks or self.maps):
            raise LabError("a data set holds trials or maps; ask for one of them")


def truth_file(folder: Path) -> Path:
    """Return the file beside a data set's folder that tells what is hidden in it."""
    return folder.with_name(folder.name + ".truth.json")


def draw_factors(scatter: Scatter, rng: np.random.Generator) -> Factors:
    """Draw this trial's friction and curvature over the robot's."""
    sd = np.array([scatter.friction_tangential, scatter.friction_normal, scatter.curvature])
    drawn = np.maximum(1.0 + sd * rng.standard_normal(3), 0.05)
    return Factors(*(float(f) for f in drawn))


def tracks(
    truth: Truth, trials: Sequence[Trial], seed: int, recording: Recording = Recording()
) -> Iterator[tuple[Trial, np.ndarray, np.ndarray]]:
    """Run the trials; yield each with its labels (T,) and its tracks (T, markers, 2), NaN where lost.

    Every trial has its own random numbers, so the tracks of a trial do not depend on the others.
    """
    view = picture if recording.markers == "tail_to_head" else centre_picture
    wrong, other = _wrong(trials, seed, recording)[1:]
    for number, trial in enumerate(trials):
        rng = np.random.default_rng([seed, 1, number])
        factors = draw_factors(truth.scatter, rng)
        if number == wrong:
            factors = Factors(*np.multiply(dataclasses.astuple(factors), dataclasses.astuple(other)))
        labels = label_times(trial.duration_s, recording.rate_hz)
        seen = view(truth, trial, labels, factors)
        places = measured(seen, recording.marker_sd_m, recording.lost, rng)
        # numbers of their own: what is disturbed does not change what is not
        own, common = np.random.default_rng([seed, 6, number]), np.random.default_rng([seed, 7])
        yield trial, labels, disturbed(places, trial, labels, recording, recording.marker_sd_m, own, common)


def _wrong(
    trials: Sequence[Trial], seed: int, recording: Recording
) -> tuple[list[Trial], int | None, Factors]:
    """Return the trials as noted, which one is wrong (if any), and its robot's factors."""
    if not recording.wrong_entry:
        return list(trials), None, Factors()
    return mistaken(list(trials), recording.wrong_entry, np.random.default_rng([seed, 8]))


def write_dataset(
    folder: Path, truth: Truth, trials: Sequence[Trial], seed: int, recording: Recording = Recording()
) -> Path:
    """Write a data set, and ``<folder>.truth.json`` beside it; return the folder.

    Parameters
    ----------
    folder : Path
        Appears whole; a data set that is there already is replaced.
    truth : Truth
    trials : sequence of Trial
        Also the gaits of maps.csv (each once).
    seed : int
        Of noise, losses and trial-to-trial scatter.
    recording : Recording

    Raises
    ------
    LabError
        The folder holds something else, or the truth makes no sense.
    """
    folder = Path(folder)
    names = [trial.name for trial in trials]
    if not names or len(set(names)) < len(names):
        raise LabError("a data set needs trials, each with its own name")
    with whole_folder(folder) as scratch:
        _write_descriptions(scratch, folder.name, truth, recording)
        noted, wrong, _ = _wrong(trials, seed, recording)
        if recording.tracks:
            _write_trials(scratch, noted)
            for trial, labels, places in tracks(truth, trials, seed, recording):
                _write_track(scratch / "trials" / f"{trial.name}.csv", labels, places, recording)
        if recording.bench:
            write_bench(scratch, truth, np.random.default_rng([seed, 2]))
        if recording.maps:
            write_table(scratch / "maps.csv", COLUMNS, _map(truth, trials, seed, recording))
    record = {"seed": seed, "truth": truth.to_record(), "recording": dataclasses.asdict(recording)}
    record["wrong_trial"] = None if wrong is None else trials[wrong].name
    write_text(truth_file(folder), json.dumps(record, indent=1) + "\n")
    return folder


def _write_descriptions(folder: Path, name: str, truth: Truth, recording: Recording) -> None:
    stated = recording.marker_sd_m if recording.stated_sd_m is None else recording.stated_sd_m
    about = {
        "name": name,
        "robot": "robot.yaml",
        "camera": {"rate_hz": float(recording.rate_hz), "marker_sd_m": float(stated)},
        "markers": recording.markers,
    }
    write_text(folder / "dataset.yaml", yaml.safe_dump(about, sort_keys=False))
    robot = {**truth.documented, **(truth.bench or truth.parameters).to_record()}
    if truth.relative_sd:
        robot["relative_sd"] = {key: float(sd) for key, sd in truth.relative_sd.items()}
    write_text(folder / "robot.yaml", yaml.safe_dump(robot, sort_keys=False))


def _write_trials(folder: Path, trials: Sequence[Trial]) -> None:
    optional = {
        "schedule": [f"schedules/{trial.name}.csv" if trial.schedule else "" for trial in trials],
        "tether": ["yes" if trial.tether else "no" for trial in trials],
        "replicate_of": [trial.replicate_of for trial in trials],
        "kind": [trial.kind for trial in trials],
    }
    plain = {"schedule": "", "tether": "yes", "replicate_of": "", "kind": "gait"}
    used = [key for key, cells in optional.items() if any(cell != plain[key] for cell in cells)]
    rows = [
        [
            t.name,
            _short(t.frequency_hz),
            _short(t.pressure_kpa),
            _short(t.offset),
            f"{t.phase_lag_rad:.6f}",
            f"{t.heading_rad:.6f}",
            f"{t.duration_s:.3f}",
            *(optional[key][n] for key in used),
        ]
        for n, t in enumerate(trials)
    ]
    write_table(folder / "trials.csv", [*_TRIAL_COLUMNS, *used], rows)
    _write_schedules(folder, trials)


def _short(value: float) -> str:
    """Return one decimal where that is exact, else nine."""
    return f"{value:.1f}" if float(f"{value:.1f}") == value else f"{value:.9f}"


def _write_schedules(folder: Path, trials: Sequence[Trial]) -> None:
    for trial in trials:
        if trial.schedule:
            write_table(
                folder / "schedules" / f"{trial.name}.csv",
                ("segment", "on_s", "off_s", "period_s"),
                [
                    (s, f"{on:.6f}", f"{off:.6f}", f"{trial.schedule.period_s:.6f}")
                    for s, on, off in trial.schedule.entries
                ],
            )


def _write_track(path: Path, labels: np.ndarray, places: np.ndarray, recording: Recording) -> None:
    whole = recording.markers == "tail_to_head"
    numbers = range(1, places.shape[1] + 1)
    columns = [c for i in numbers for c in (f"x{i}_m", f"y{i}_m")] if whole else ["x_m", "y_m"]
    flat = places.reshape(len(labels), -1)
    rows = [
        f"{t:.6f}," + ",".join("" if np.isnan(v) else f"{v:.5f}" for v in row)
        for t, row in zip(labels, flat.tolist())
    ]
    write_text(path, "\n".join(["time_s," + ",".join(columns), *rows]) + "\n")


def _map(truth: Truth, trials: Sequence[Trial], seed: int, recording: Recording) -> list[tuple[str, ...]]:
    gaits = {(t.frequency_hz, t.pressure_kpa, t.offset, t.phase_lag_rad): t for t in reversed(trials)}
    chosen = [gaits[key] for key in sorted(gaits)]
    factors = [
        [
            draw_factors(truth.scatter, np.random.default_rng([seed, 3, n, r]))
            for r in range(recording.replicates)
        ]
        for n in range(len(chosen))
    ]
    return map_rows(truth, chosen, factors)

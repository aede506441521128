"""What each trial of a data set shows, in numbers."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from srs_opt.calibrate.candidates import fitted_coordinates
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.noise import noise_of
from srs_opt.calibrate.rejection import rejection_reason
from srs_opt.errors import InputError, NoAnswerError
from srs_opt.measurement.motion import Motion, trial_motion
from srs_opt.measurement.records import Array, DataSet, Trial
from srs_opt.measurement.shape import shape_from_markers
from srs_opt.measurement.smooth import Intensity, SmoothShape, smooth_shape
from srs_opt.measurement.valve_wave import ValveWave, first_curvatures
from srs_opt.problem import Problem
from srs_opt.robot import Robot

FEWEST_FRAMES = 10
BENDS_CYCLES, BENDS_S = 3.0, 6.0  # what is drawn of the bends: more cycles can no longer be told apart


@dataclass(frozen=True, eq=False)
class Bends:
    """Curvatures of a trial's first cycles with their deviations, and those that the robot file expects.

    Attributes
    ----------
    seen : SmoothShape
    expected_1_m : ndarray, shape (T, N-1), or None
        Of the valves' wave from rest; None where the drive is a record.
    """

    seen: SmoothShape
    expected_1_m: Array | None


@dataclass(frozen=True)
class Seen:
    """What one trial shows.

    Attributes
    ----------
    trial : Trial
    lost : tuple of float
        Share of the frames in which each marker was lost.
    longest_gap_s : float
        Longest time without one of the markers.
    shape_m, model_m : float or None
        Root mean square per coordinate of what the fitted shapes, and the robot file's motion, leave.
    motion : Motion or None
        Steady motion; its own residual is what a periodic gait leaves.
    bends : Bends or None
        None without markers or without a gait.
    warnings : tuple of str
    """

    trial: Trial
    lost: tuple[float, ...]
    longest_gap_s: float
    shape_m: float | None
    model_m: float | None
    motion: Motion | None
    bends: Bends | None
    warnings: tuple[str, ...]

    def record(self) -> dict[str, Any]:
        """Return the numbers for JSON."""
        return {
            "trial": self.trial.name,
            "lost": [round(v, 6) for v in self.lost],
            "longest_gap_s": self.longest_gap_s,
            "residual_m": {
                "shape": self.shape_m,
                "gait": self.motion.residual_m if self.motion else None,
                "model": self.model_m,
            },
            "motion": dataclasses.asdict(self.motion) if self.motion else None,
            "warnings": list(self.warnings),
        }


def look(
    dataset: DataSet, robot: Robot, problems: Sequence[Problem], tell: Callable[[str], None]
) -> tuple[Seen, ...]:
    """Return what every trial shows, held against `robot`.

    Raises
    ------
    InputError
        If `robot` has another number of links than the data set's.
    """
    if robot.links != dataset.robot.links:
        raise InputError(
            f"robot '{robot.name}' has {robot.links} links, that of data set '{dataset.name}' has "
            f"{dataset.robot.links}"
        )
    simulated = [t for t in dataset.trials if not rejection_reason(t)]
    experiment = Experiment(Model(robot), simulated, noise_of(dataset))
    start = Point({c.name: 0.0 for c in fitted_coordinates(robot) if not c.effect})
    found: list[Seen] = []
    intensity = None
    for trial in dataset.trials:
        tell(f"trial {trial.name}")
        warnings = [p.message for p in problems if p.file.endswith(f"/{trial.name}.csv")]
        bends = _bends(dataset, robot, trial, intensity)
        intensity = bends.seen.intensity if bends else intensity
        found.append(_seen(dataset, robot, trial, experiment, start, bends, warnings))
    return tuple(found)


def _bends(dataset: DataSet, robot: Robot, trial: Trial, intensity: Intensity | None) -> Bends | None:
    """Return the bends of the first cycles, smoothed with `intensity` (found from this trial if None)."""
    if trial.markers_m is None or trial.kind != "gait" or not trial.frequency_hz > 0:
        return None
    duration = min(max(BENDS_CYCLES / trial.frequency_hz, 1.0), BENDS_S)
    first = trial.time_s < trial.time_s[0] + duration
    time, points = trial.time_s[first], trial.markers_m[first]
    if np.isnan(points).all() or len(time) < FEWEST_FRAMES:
        return None
    seen = smooth_shape(robot, time, points, dataset.marker_sd_m, intensity, trial.spots)
    if trial.applied:
        return Bends(seen, None)
    gait = ValveWave(
        trial.frequency_hz, trial.pressure_kpa, trial.offset, trial.phase_lag_rad, schedule=trial.schedule
    )
    return Bends(seen, first_curvatures(robot, gait, time))


def _seen(
    dataset: DataSet,
    robot: Robot,
    trial: Trial,
    experiment: Experiment,
    start: Point,
    bends: Bends | None,
    warnings: list[str],
) -> Seen:
    points = trial.markers_m if trial.markers_m is not None else trial.centre_m
    assert points is not None
    gone = np.isnan(points.reshape(len(points), -1, 2)[..., 0])
    shape_m = model_m = motion = None
    if trial.markers_m is not None and not gone.all():
        shape = shape_from_markers(robot, trial.markers_m, dataset.marker_sd_m, spots=trial.spots)
        values = 2 * int((~gone).sum())
        shape_m = float(np.sqrt(shape.misfit.sum() / values)) * dataset.marker_sd_m
    if trial.kind == "gait":
        try:
            motion = trial_motion(trial, dataset.marker_sd_m, robot.length_m)
        except InputError as error:
            warnings.append(str(error))
        else:
            if not motion.settled:
                warnings.append("the gait still changes from cycle to cycle in the trial's second half")
    reason = rejection_reason(trial)
    if reason:
        warnings.append(f"not simulated: {reason}")
    else:
        try:
            left = experiment.residuals([trial], start)[0]
            model_m = float(np.sqrt(np.nanmean(left**2)))
        except NoAnswerError as error:
            warnings.append(str(error))
    return Seen(
        trial,
        tuple(float(v) for v in gone.mean(axis=0)),
        float(max(_longest_run(column) for column in gone.T) / dataset.rate_hz),
        shape_m,
        model_m,
        motion,
        bends,
        tuple(warnings),
    )


def _longest_run(flags: np.ndarray) -> int:
    """Return the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return int((edges[1::2] - edges[::2]).max()) if edges.size else 0

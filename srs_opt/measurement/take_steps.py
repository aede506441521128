"""Step tests made from recordings: the shape's curvature over time in trials of kind ``step``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.records import DataSet, StepTest, Trial
from srs_opt.measurement.shape import shape_from_markers
from srs_opt.measurement.steps import fit_step
from srs_opt.measurement.take_settings import STEP_TAKE

LIFTED = "lifted"


def steps_of(dataset: DataSet) -> tuple[tuple[StepTest, ...], tuple[str, ...]]:
    """Return a step test for every trial of kind ``step``, and what is doubtful about them.

    The segment is the one that bends most; its curvature counts from that at rest. The condition is
    ``lifted`` where the trial's floor says so, else ``ground``.

    Raises
    ------
    InputError
        If there is no such trial, or one does not show the markers.
    """
    trials = [t for t in dataset.trials if t.kind == "step"]
    if not trials:
        raise InputError(
            f"data set '{dataset.name}' has no trial of kind 'step': take a static test per trial, with its "
            "pressure_kpa, kind step, and floor 'lifted' where the robot did not touch the ground"
        )
    tests, notes = [], []
    for trial in trials:
        test, note = _step_of(dataset, trial)
        tests.append(test)
        notes += note
    return tuple(tests), tuple(notes)


def _step_of(dataset: DataSet, trial: Trial) -> tuple[StepTest, list[str]]:
    points = trial.markers_m
    if points is None:
        raise InputError(f"trial '{trial.name}' has no markers: a step's curvature needs them")
    whole = np.isfinite(points[..., 0]).sum(axis=1) >= max(points.shape[1] - 1, 2)
    if whole.sum() < STEP_TAKE.least_frames:
        raise InputError(f"trial '{trial.name}': only {int(whole.sum())} frames show (nearly) all markers")
    shape = shape_from_markers(dataset.robot, points[whole], dataset.marker_sd_m, spots=trial.spots)
    time, kappa = trial.time_s[whole], shape.curvature_1_m
    rest = np.median(kappa[: STEP_TAKE.rest_frames], axis=0)
    change = np.median(kappa[-max(len(kappa) // 4, STEP_TAKE.rest_frames) :], axis=0) - rest
    order = np.argsort(-np.abs(change))
    segment = int(order[0])
    # the rest lasts at least half as long as the first fifth of the rise is not yet reached
    risen = np.abs(kappa[:, segment] - rest[segment]) > STEP_TAKE.risen_share * abs(change[segment])
    before = max(int(np.argmax(risen)) // 2, STEP_TAKE.rest_frames)
    at_rest = float(kappa[:before, segment].mean())
    notes = []
    if abs(change[order[1]]) > STEP_TAKE.alone_share * abs(change[segment]):
        notes.append(
            f"trial '{trial.name}': segments {segment + 1} and {int(order[1]) + 1} both bend "
            f"({change[segment]:+.3g} and {change[order[1]]:+.3g} 1/m); taken for a step of {segment + 1}"
        )
    if not shape.determined.mean() > 0.5:
        notes.append(f"trial '{trial.name}': these markers do not determine every curvature")
    condition = LIFTED if (trial.floor or "").strip().casefold() == LIFTED else "ground"
    curvature = kappa[:, segment] - at_rest
    test = StepTest(trial.name, segment + 1, condition, trial.pressure_kpa, time - time[0], curvature)
    # bench steps begin with the valve; what passes before the bend begins is rest, or the valve's dead time
    begin = fit_step(test, fit_delay=True).delay_s
    after = test.time_s >= begin
    still = ~after if (~after).sum() >= STEP_TAKE.rest_frames else slice(0, STEP_TAKE.rest_frames)
    curvature = kappa[after, segment] - kappa[still, segment].mean()
    return replace(test, time_s=test.time_s[after] - begin, curvature_1_m=curvature), notes

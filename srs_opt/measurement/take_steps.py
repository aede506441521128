"""Step tests made from recordings: the shape's curvature over time in trials of kind ``step``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.records import DataSet, StepTest, Trial
from srs_opt.measurement.shape import shape_from_markers
from srs_opt.measurement.steps import fit_step

LIFTED = "lifted"
REST_FRAMES = 3
RISEN = 0.2
ALONE = 0.5  # of the largest change: what another segment may bend without the test being doubtful
FEWEST_FRAMES = 8


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
    if whole.sum() < FEWEST_FRAMES:
        raise InputError(f"trial '{trial.name}': only {int(whole.sum())} frames show (nearly) all markers")
    shape = shape_from_markers(dataset.robot, points[whole], dataset.marker_sd_m, spots=trial.spots)
    time, kappa = trial.time_s[whole], shape.curvature_1_m
    rest = np.median(kappa[:REST_FRAMES], axis=0)
    change = np.median(kappa[-max(len(kappa) // 4, REST_FRAMES) :], axis=0) - rest
    order = np.argsort(-np.abs(change))
    segment = int(order[0])
    # the rest lasts at least half as long as the first fifth of the rise is not yet reached
    risen = np.abs(kappa[:, segment] - rest[segment]) > RISEN * abs(change[segment])
    before = max(int(np.argmax(risen)) // 2, REST_FRAMES)
    at_rest = float(kappa[:before, segment].mean())
    notes = []
    if abs(change[order[1]]) > ALONE * abs(change[segment]):
        notes.append(
            f"trial '{trial.name}': segments {segment + 1} and {int(order[1]) + 1} both bend "
            f"({change[segment]:+.3g} and {change[order[1]]:+.3g} 1/m); taken for a step of {segment + 1}"
        )
    if not shape.determined.mean() > ALONE:
        notes.append(f"trial '{trial.name}': these markers do not determine every curvature")
    condition = LIFTED if (trial.floor or "").strip().casefold() == LIFTED else "ground"
    curvature = kappa[:, segment] - at_rest
    test = StepTest(trial.name, segment + 1, condition, trial.pressure_kpa, time - time[0], curvature)
    # bench steps begin with the valve; what passes before the bend begins is rest, or the valve's dead time
    begin = fit_step(test, fit_delay=True).delay_s
    after = test.time_s >= begin
    still = ~after if (~after).sum() >= REST_FRAMES else slice(0, REST_FRAMES)
    curvature = kappa[after, segment] - kappa[still, segment].mean()
    return replace(test, time_s=test.time_s[after] - begin, curvature_1_m=curvature), notes

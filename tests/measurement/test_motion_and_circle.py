"""Speed, turn rate, radius and circles against an independent simulation's steady motion."""

import math

import numpy as np
import pytest
from measure_fixtures import ROBOT, binomial_allows

from srs_opt.errors import InputError, NoAnswerError
from srs_opt.measurement.circle import fit_circle
from srs_opt.measurement.motion import dataset_motions, motion_map, trial_motion
from srs_opt.measurement.records import DataSet, Trial
from virtual_lab.maps import steady_motion
from virtual_lab.simulate import run
from virtual_lab.trials import Trial as LabTrial
from virtual_lab.truth import Truth

RATE = 120.0


def lab(frequency, offset, seconds=7.9):
    trial = LabTrial("a", frequency, 50.0, offset, math.pi / 2, 0.3, seconds)
    time = np.arange(round(seconds * RATE)) / RATE
    return time, run(Truth(), trial, time), steady_motion(Truth(), trial, settle_s=4.0)


def measured(time, path, frequency, offset, seed=0, lost=0.0, centre=False, name="a", kind="gait"):
    rng = np.random.default_rng(seed)
    points = path.centre_of_mass() if centre else np.stack([path.x, path.y], axis=-1)
    points = points + 1e-3 * rng.normal(size=points.shape)
    if not centre:
        points[rng.random(points.shape[:2]) < lost] = np.nan
    both = (None, points) if centre else (points, None)
    return Trial(name, frequency, 50.0, offset, math.pi / 2, 0.3, float(time[-1]), time, *both, kind=kind)


@pytest.mark.parametrize(("lost", "centre"), [(0.0, False), (0.5, False), (0.0, True)])
@pytest.mark.parametrize(("frequency", "offset"), [(2.0, 0.4), (1.7, 0.0), (1.3, -0.3)])
def test_against_the_steady_motion(frequency, offset, lost, centre):
    time, path, truth = lab(frequency, offset)
    found = trial_motion(
        measured(time, path, frequency, offset, lost=lost, centre=centre), 1e-3, ROBOT.length_m
    )
    assert found.settled
    assert found.speed_m_s.value == pytest.approx(truth.speed_m_s, abs=4e-4)
    assert found.turn_rate_rad_s.value == pytest.approx(truth.turn_rate_rad_s, abs=4e-3)
    assert (found.radius_m is None) == (offset == 0.0)
    if found.radius_m is not None:
        assert found.radius_m.value == pytest.approx(truth.radius_m, rel=0.01)
        assert found.radius_m.low < found.radius_m.value < found.radius_m.high
    assert found.from_s > 1 / frequency / 2
    assert found.residual_m == pytest.approx(1e-3, rel=0.1)


def test_intervals_cover():
    runs, hits = 40, np.zeros(3, dtype=int)
    time, path, truth = lab(1.7, 0.3, seconds=6.0)
    for seed in range(runs):
        found = trial_motion(measured(time, path, 1.7, 0.3, seed=seed), 1e-3, ROBOT.length_m, confidence=0.9)
        pairs = zip(
            (found.speed_m_s, found.turn_rate_rad_s, found.radius_m),
            (truth.speed_m_s, truth.turn_rate_rad_s, truth.radius_m),
        )
        hits += [interval.low < value < interval.high for interval, value in pairs]
    assert all(binomial_allows(int(h), runs, 0.9) for h in hits), hits


def test_a_slow_transient_is_left_out():
    time = np.arange(960) / RATE
    x = 0.2 * time + 0.08 * np.exp(-time / 0.8)  # creeps up to its speed
    points = (
        np.stack([x, 0.01 * np.sin(4 * np.pi * time)], axis=-1)[:, None]
        + np.array([0.049, 0]) * np.arange(5)[:, None]
    )
    points = points + 1e-3 * np.random.default_rng(0).normal(size=points.shape)
    found = trial_motion(Trial("a", 2.0, 50, 0, 1.57, 0, 8.0, time, points), 1e-3, ROBOT.length_m)
    assert found.from_s > 1.0
    assert found.speed_m_s.value == pytest.approx(0.2, abs=2e-3)


def test_still_changing_is_said():
    time = np.arange(960) / RATE
    points = np.stack([0.02 * time**2, 0.01 * np.sin(4 * np.pi * time)], axis=-1)[:, None]
    points = points + np.array([0.049, 0]) * np.arange(5)[:, None]
    points = points + 1e-3 * np.random.default_rng(0).normal(size=points.shape)
    assert not trial_motion(Trial("a", 2.0, 50, 0, 1.57, 0, 8.0, time, points), 1e-3, ROBOT.length_m).settled


def test_too_short_or_no_gait():
    time, path, _ = lab(2.0, 0.0, seconds=1.2)
    with pytest.raises(InputError, match="whole cycles"):
        trial_motion(measured(time, path, 2.0, 0.0), 1e-3, ROBOT.length_m)
    with pytest.raises(InputError, match="still"):
        trial_motion(measured(time, path, 2.0, 0.0, kind="still"), 1e-3, ROBOT.length_m)


def test_map_averages_replicates():
    trials = []
    for offset in (0.0, 0.4):
        time, path, _ = lab(2.0, offset, seconds=4.0)
        trials += [measured(time, path, 2.0, offset, seed=i, name=f"{offset}-{i}") for i in range(3)]
    dataset = DataSet("d", ROBOT, RATE, 1e-3, trials=tuple(trials))
    motions = dataset_motions(dataset)
    straight, turning = motion_map(dataset, motions)
    assert (straight.replicates, turning.replicates) == (3, 3)
    assert straight.radius_m is None
    assert turning.radius_m > 0
    speeds = [m.speed_m_s.value for m in motions[3:]]
    assert turning.speed_m_s == pytest.approx(np.mean(speeds))
    assert turning.speed_sd_m_s == pytest.approx(np.std(speeds, ddof=1))


@pytest.mark.parametrize("turn", [1, -1])
@pytest.mark.parametrize("arc", [0.5, 2.0, 9.0])
def test_circle(turn, arc):
    rng = np.random.default_rng(0)
    hits, runs = 0, 60
    for _ in range(runs):
        angle = turn * np.linspace(0, arc, 200) + 1
        points = np.column_stack([3 + 0.25 * np.cos(angle), -1 + 0.25 * np.sin(angle)])
        found = fit_circle(points + 1e-3 * rng.normal(size=points.shape))
        assert found.radius_m * turn > 0
        assert found.arc_rad == pytest.approx(arc, abs=0.15)
        hits += abs(abs(found.radius_m) - 0.25) < 1.645 * found.radius_sd_m
    assert binomial_allows(hits, runs, 0.9), hits


def test_no_circle():
    line = np.column_stack([np.arange(10.0), 2 * np.arange(10.0)])
    with pytest.raises(NoAnswerError, match="line"):
        fit_circle(line)
    with pytest.raises(NoAnswerError, match="same"):
        fit_circle(np.ones((10, 2)))
    with pytest.raises(InputError, match="four"):
        fit_circle(np.full((10, 2), np.nan))


def test_pictures(tmp_path):
    from srs_opt.figures import save_figure
    from srs_opt.measurement.figures import bends_figure, circle_figure, step_figure, track_figure
    from srs_opt.measurement.records import StepTest
    from srs_opt.measurement.smooth import Intensity, smooth_shape
    from srs_opt.measurement.steps import fit_step
    from srs_opt.model.actuator_law import step_response

    time, path, _ = lab(2.0, 0.4, seconds=2.0)
    trial = measured(time, path, 2.0, 0.4)
    t = np.arange(100) * 0.01
    test = StepTest("a", 1, "ground", 41.0, t, 14 * step_response(t, 0.065, 0.05) + 0.01 * np.sin(99 * t))
    shape = smooth_shape(ROBOT, time, trial.markers_m, 1e-3, Intensity(0.01, 6.0, 1e5))
    figures = {
        "track": track_figure(trial),
        "circle": circle_figure(path.centre_of_mass(), fit_circle(path.centre_of_mass())),
        "steps": step_figure([test], [fit_step(test)]),
        "shape": bends_figure(shape),
    }
    for name, figure in figures.items():
        assert all(file.stat().st_size > 5000 for file in save_figure(figure, tmp_path / name))

"""Slopes of the predicted picture against differences of the prediction itself."""

from dataclasses import replace

import numpy as np
import pytest

from srs_opt.calibrate.candidates import all_candidates
from srs_opt.calibrate.coordinates import base_coordinates
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit import start_point
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.trials import Request
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.records import Trial
from srs_opt.robot import wpi_srs

FINE_M_S = 2e-8


@pytest.fixture(scope="module")
def setting():
    robot = wpi_srs()
    time_s = np.arange(120) / 100
    blank = np.zeros((time_s.size, robot.links, 2))
    trial = Trial("t", 1.5, 48.0, 0.4, np.pi / 2, 0.7, 1.2, time_s, markers_m=blank)
    experiment = Experiment(Model(robot), [trial], 0.001).work
    base = base_coordinates(robot)
    sizes = tuple(c for k in all_candidates(robot.links) for c in k.sizes)
    values = {**start_point(base).values, "curvature_bias.bias": 0.5, "camera_scale.scale": 0.02}
    jacobian = experiment.predict("t", Point(values), (*base, *sizes), FINE_M_S).jacobian
    return experiment, values, (*base, *sizes), jacobian


# derivatives are of order 2 in the step: a few per mille here, enough for Gauss-Newton to converge
@pytest.mark.parametrize(
    "name",
    [
        "friction_tangential",
        "friction_normal",
        "curvature_per_pressure_1_m_kpa",
        "tau1_s",
        "gap_length.extra_m",
        "gap_bending.ratio",
        "segment_bias.bias[3]",
        "single_wheel_toe.angle[2]",
        "head_mass.extra_kg",
        "tether_drag.force_n",
        "slip_rate.per_speed",
        "curvature_stiffening.per_curv2",
        "hysteresis.ratio",
        "fill_exhaust_asymmetry.ratio",
        "supply_droop.per_hz",
        "floor_slope.x",
        "marker_offset.dy_m",
        "camera_tilt.per_m",
        "clock_offset.offset_s",
    ],
)
def test_derivatives_are_those_of_the_prediction(setting, name):
    experiment, values, coordinates, jacobian = setting
    k = [c.name for c in coordinates].index(name)
    h = 2e-3 * coordinates[k].typical
    ends = [
        experiment.predict("t", Point({**values, name: values.get(name, 0.0) + s * h}), (), FINE_M_S).points
        for s in (1, -1)
    ]
    difference = (ends[0] - ends[1]) / (2 * h)
    error = np.linalg.norm(jacobian[:, :, k] - difference) / np.linalg.norm(difference)
    assert error < 0.06


def test_a_dead_time_is_a_late_clock(setting):
    experiment, values, coordinates, jacobian = setting
    names = [c.name for c in coordinates]
    late, clock = (jacobian[:, :, names.index(n)] for n in ("dead_time.delay_s", "clock_offset.offset_s"))
    assert late == pytest.approx(-clock)
    plain = {
        k: v for k, v in values.items() if "bias" not in k
    }  # a bias acts from time 0 whatever the valves do
    delayed = experiment.predict("t", Point({**plain, "dead_time.delay_s": 0.03}), (), FINE_M_S).points
    shifted = experiment.predict("t", Point({**plain, "clock_offset.offset_s": -0.03}), (), FINE_M_S).points
    assert np.abs(delayed - shifted).max() < 1e-6


def test_a_camera_that_sees_its_markers_one_after_the_other():
    """Each marker is seen where it is its own lag later; the derivative is that of the prediction."""
    robot, lag_s = wpi_srs(), 0.02
    time_s = np.arange(40) / 50
    trials = [
        Trial(f"t{k}", 1.5, 48.0, 0.4, np.pi / 2, 0.7, 1.0, time_s + k * lag_s,
              markers_m=np.zeros((time_s.size, robot.links, 2)))
        for k in range(robot.links)
    ]  # fmt: skip
    work = Experiment(Model(robot, generic=True), trials, 0.001).work
    values, name = start_point(base_coordinates(robot)).values, "generic_camera_rows.lag_s"
    late = work.predict("t0", Point({**values, name: lag_s})).points
    for k in range(robot.links):
        plain = work.predict(f"t{k}", Point(values)).points
        assert late[:, 2 * k : 2 * k + 2] == pytest.approx(plain[:, 2 * k : 2 * k + 2], abs=2e-5)
    (size,) = (c for f in work.model.forms for c in f.sizes if c.name == name)
    derivative = work.predict("t0", Point({**values, name: lag_s}), (size,)).jacobian[:, :, 0]
    ends = [work.predict("t0", Point({**values, name: lag_s + h})).points for h in (1e-3, -1e-3)]
    assert derivative == pytest.approx((ends[0] - ends[1]) / 2e-3, abs=0.02)


def test_derivatives_of_the_same_place_serve_again_whoever_is_asked(setting, monkeypatch):
    """A place is simulated and derived once; a worker that is handed the memory gives the same bits."""
    robot, coordinates = wpi_srs(), setting[2]
    base = base_coordinates(robot)
    blank = np.zeros((60, robot.links, 2))
    trial = Trial("t", 1.5, 48.0, 0.4, np.pi / 2, 0.7, 0.6, np.arange(60) / 100, markers_m=blank)
    work = Experiment(Model(robot), [trial], 0.001).work
    here, there = start_point(base), Point({**start_point(base).values, "tau1_s": 0.01})
    first = work.answer(["t"], Request(here, base))["t"]
    wider = Request(here, (*base, *coordinates[len(base) : len(base) + 2]))
    part = work.part(["t"])
    part.remember(work.memory(["t"], wider))
    elsewhere = part.answer(["t"], wider)["t"]
    wide = work.answer(["t"], wider)["t"]
    assert np.array_equal(wide.raw, elsewhere.raw) and not wide.stale
    kept = [*range(len(base)), -1]
    assert np.allclose(
        wide.raw[np.ix_(kept, kept)], first.raw, rtol=1e-5, atol=1e-6 * np.abs(first.raw).max()
    )

    monkeypatch.setattr("srs_opt.calibrate.observe.variation", None)  # not needed any more
    assert not work.answer(["t"], wider)["t"].stale
    assert work.answer(["t"], Request(there, wider.coordinates, stale=True))["t"].stale


@pytest.mark.parametrize("where", ["points", "jacobian"])
def test_a_motion_without_finite_derivatives_is_no_place_for_a_fit(where, monkeypatch):
    robot = wpi_srs()
    base = base_coordinates(robot)
    blank = np.zeros((60, robot.links, 2))
    trial = Trial("t", 1.5, 48.0, 0.4, np.pi / 2, 0.7, 0.6, np.arange(60) / 100, markers_m=blank)
    experiment = Experiment(Model(robot), [trial], 0.001)
    whole = experiment.work._predicted

    def broken(*arguments):
        prediction = whole(*arguments)
        spoilt = np.array(getattr(prediction, where))
        spoilt[-1] = np.nan
        return replace(prediction, **{where: spoilt})

    monkeypatch.setattr(experiment.work, "_predicted", broken)
    with pytest.raises(NoAnswerError, match="trial t: the motion has no finite derivatives"):
        experiment.normal_equations(start_point(base), base)

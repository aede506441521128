"""The pieces behind the derivatives: a second derivation, the small structure, the tolerance."""

import numpy as np
import pytest

from srs_opt.calibrate.candidates import all_candidates
from srs_opt.calibrate.coordinates import base_coordinates
from srs_opt.calibrate.experiment import Experiment, Point
from srs_opt.calibrate.fit import start_point
from srs_opt.calibrate.fit_settings import DERIVATIVE
from srs_opt.calibrate.initial_pose import initial_pose
from srs_opt.calibrate.model import Model
from srs_opt.calibrate.sensitivity import variation
from srs_opt.calibrate.trial_simulation import (
    TRIAL,
    _fitted,
    conditions_of,
    tolerance_for,
)
from srs_opt.measurement.records import Trial
from srs_opt.orbit.sensitivity import tangent_kernel
from srs_opt.robot import wpi_srs
from srs_opt.simulate import compiled
from srs_opt.simulate.kernel import Course
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.rosenbrock import BODY_STATES


@pytest.fixture(scope="module")
def setting():
    robot = wpi_srs()
    time_s = np.arange(60) / 100
    blank = np.zeros((time_s.size, robot.links, 2))
    trial = Trial("t", 2.0, 48.0, 0.4, np.pi / 2, 0.7, 0.6, time_s, markers_m=blank)
    base = base_coordinates(robot)
    return Experiment(Model(robot), [trial], 0.001), trial, base, start_point(base)


def test_the_small_structure_gives_the_derivatives_of_the_full_one(setting):
    experiment, trial, base, start = setting
    model = experiment.model
    effects = tuple(c for k in all_candidates(model.links) for c in k.sizes)
    nodes = experiment.work.runs["t"](start.values)
    seeds = model.seeds(start.values, conditions_of(trial), base).p
    typical = np.ones(len(base))
    found = []
    for coordinates in (base, (*base, *effects)):
        structure, kept = model.structure(start.values, coordinates)
        found.append(variation(structure, nodes, nodes.p[kept], seeds[kept], typical, trial.heading_rad))
    assert structure == model.rigid[-1]
    # linear actuators are integrated exactly, those with all effects to the order of the scheme
    assert found[0].pose == pytest.approx(found[1].pose, rel=1e-4, abs=1e-5)
    assert found[0].shape == pytest.approx(found[1].shape, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize(
    "effects", [(), ("tether_drag.force_n",), ("hysteresis.ratio", "segment_bias.bias[2]")]
)
def test_differences_are_the_tangents_of_the_integration(setting, effects, monkeypatch):
    experiment, trial, base, start = setting
    model = experiment.model
    sizes = {"tether_drag.force_n": 0.02, "hysteresis.ratio": 0.1, "segment_bias.bias[2]": 0.4}
    values = {**start.values, **{name: sizes[name] for name in effects}}
    added = tuple(c for k in all_candidates(model.links) for c in k.sizes if c.name in effects)
    coordinates = (*base, *added)
    nodes = experiment.work.runs["t"](values)
    structure, kept = model.structure(values, coordinates)
    seeds = model.seeds(values, conditions_of(trial), coordinates).p[kept]
    typical = np.array([c.typical for c in coordinates])
    found = variation(structure, nodes, nodes.p[kept], seeds, typical, trial.heading_rad)
    tangent_kernel.cache_clear()
    monkeypatch.setattr(compiled, "compiler", lambda: None)  # would take longer than these few steps
    kernel, n = tangent_kernel(structure), structure.segments
    tangent_kernel.cache_clear()
    state = nodes.start
    h = np.diff(nodes.time_s)
    inputs = np.column_stack([nodes.valve, np.zeros(h.size)])
    for k in range(len(coordinates)):
        p = np.concatenate([nodes.p[kept], seeds[:, k]])
        moved = np.zeros(state.size)
        moved[:3] = initial_pose(structure, nodes.p[kept], trial.heading_rad)[1] @ seeds[:, k]
        tangent = kernel.run([Course(np.concatenate([state, moved]), h, inputs, p)])[0][:, state.size :, 0]
        rounding = 1e-14 / (DERIVATIVE.perturbation * typical[k])  # of states of the order of one
        for mine, theirs in (
            (found.pose[1:, :, k], tangent[:, :3]),
            (found.shape[1:, :, k], tangent[:, BODY_STATES : BODY_STATES + n]),
        ):
            error = np.abs(mine - theirs).max()
            assert error < 1e-3 * np.abs(theirs).max() + 100 * rounding, coordinates[k].name


def test_derivatives_of_a_calibration_are_exact(setting):
    experiment, trial, base, start = setting
    fine, h = 1e-7, 1e-4
    jacobian = experiment.work.predict(trial.name, start, base, fine).jacobian
    for k, coordinate in enumerate(base):
        ends = []
        for sign in (1, -1):
            moved = {**start.values, coordinate.name: start.values[coordinate.name] + sign * h}
            ends.append(experiment.work.predict(trial.name, Point(moved), (), fine).points)
        difference = (ends[0] - ends[1]) / (2 * h)
        assert np.abs(jacobian[:, :, k] - difference).max() < 1e-3 * np.abs(difference).max(), coordinate.name


def test_more_data_ask_for_a_finer_simulation():
    assert tolerance_for(1000, 0.001) == TRIAL.tolerance_m_s
    assert tolerance_for(60_000, 0.001) == pytest.approx(TRIAL.tolerance_m_s / 2)
    assert tolerance_for(60_000, 0.0005) == pytest.approx(TRIAL.tolerance_m_s / 4)
    assert tolerance_for(10**9, 1e-6) == TRIAL.finest_m_s


def test_a_mesh_serves_the_same_phases_as_it_is():
    """However short a phase is: else a motion that is simulated again differs in its last bits."""
    rng = np.random.default_rng(2)
    for _ in range(20):
        durations = np.array([*rng.uniform(0.1, 0.4, 2), 10 ** rng.uniform(-6, -3), rng.uniform(0.1, 0.4)])
        mesh = Mesh.uniform(durations, 0.005)
        mesh = mesh.refined(5e-6 * 10 ** rng.uniform(-2, 2, mesh.h_s.size), 5e-6)
        phases = (*durations, 1.0, -1.0, 1.0, -1.0)
        assert _fitted((phases, mesh), durations, phases) is mesh
        assert _fitted((phases, mesh), durations + 1e-6, phases) is not mesh

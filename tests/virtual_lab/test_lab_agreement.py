"""Without an effect, and with each listed one in both, laboratory and complex model move alike.

Two formulations and two integrators that share no code: a difference between data and model then means
something. Both smooth friction over the same speed here; the laboratory's data sets are finer.
"""

import numpy as np
import pytest

from srs_opt.gait import published_wave
from srs_opt.robot import wpi_srs
from srs_opt.simulate import compiled
from srs_opt.simulate.integrate import Integrator, step_kernel
from srs_opt.simulate.timeline import Timeline
from virtual_lab.catalogue import LISTED
from virtual_lab.draw import draw_effect
from virtual_lab.simulate import run
from virtual_lab.trials import Trial
from virtual_lab.truth import Parameters, Truth

DURATION_S = 2.0
TRIAL = Trial("t", 2.0, 55.0, 0.4, duration_s=DURATION_S)
# the curvature's equation has a corner where the bend changes side, and the model's steps do not land on it
TOLERANCE_M = {"fill_exhaust_asymmetry": 2e-3}


def compare(effects, tolerance_m, **robot_values):
    robot = wpi_srs().with_values(effects=effects, friction_speed_m_s=0.002, **robot_values)
    truth = Truth(Parameters(**robot_values), effects=effects, friction_speed_m_s=0.002)
    start = run(truth, TRIAL, np.zeros(1)).centre_of_mass()[0]
    integrator = Integrator(robot)
    timeline = Timeline.of_gait(published_wave(robot, 2.0, 55.0, 0.4).gait(), DURATION_S)
    model = integrator.integrate(timeline, integrator.rest(*start, 0.0), 1e-6)
    lab = run(truth, TRIAL, model.time_s)
    np.testing.assert_allclose(lab.centre_of_mass(), model.pose[:, :2], atol=tolerance_m)
    np.testing.assert_allclose(lab.theta.mean(axis=1), model.pose[:, 2], atol=10 * tolerance_m)


@pytest.fixture
def interpreted(monkeypatch):
    """Without a compiler: every effect has equations of its own, which compile longer than they run here."""
    step_kernel.cache_clear()
    monkeypatch.setattr(compiled, "compiler", lambda: None)
    yield
    step_kernel.cache_clear()


def test_without_any_effect():
    compare((), 5e-6)


@pytest.mark.parametrize("name", sorted(name for name, kind in LISTED.items() if kind.part != "camera"))
def test_with_one_effect(name, interpreted):
    effect = draw_effect(LISTED[name], np.random.default_rng(6), 5, (1.0, 1.0))
    compare((effect,), TOLERANCE_M.get(name, 2e-5))


@pytest.mark.parametrize("others", [(), ({"name": "gap_bending", "ratio": 0.5},)])
def test_chambers_that_lengthen_on_a_soft_body(others):
    """They lengthen with the curvature without load, whatever the load leaves of the bend."""
    compare(({"name": "chamber_stretch", "per_curv2": 3e-4}, *others), 5e-6, bending_stiffness_n_m2=0.005)

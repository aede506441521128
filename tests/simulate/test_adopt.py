"""A state handed from one model to another: the snake goes on turning as fast as it did."""

import numpy as np
import pytest

from srs_opt.gait import published_wave
from srs_opt.model.state import HEADING, YAW_MOMENTUM
from srs_opt.robot import wpi_srs
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.timeline import Timeline

ROBOT = wpi_srs()
SOFT = ROBOT.with_values(bending_stiffness_n_m2=0.02)


def test_a_straight_snake_s_yaw_momentum_is_that_of_the_model():
    exact, simplified = Integrator(ROBOT, "complex"), Integrator(ROBOT, "simplified")
    yaw_rate, mass, between = 0.7, ROBOT.link_mass_kg, ROBOT.segment_length_m + ROBOT.gap_length_m
    at = (np.arange(5) - 2) * between  # of the links
    state = exact.rest()
    state[YAW_MOMENTUM] = yaw_rate * (mass * (at**2).sum() + 5 * ROBOT.link_inertia_kg_m2)
    adopted = simplified.adopt(state, exact)
    # a third of m l^2 for either end of every arc: 8/3 m l^2 of four arcs
    assert adopted[YAW_MOMENTUM] == pytest.approx(
        yaw_rate * 8 / 3 * mass * ROBOT.segment_length_m**2, rel=1e-9
    )
    np.testing.assert_allclose(exact.adopt(adopted, simplified), state, rtol=1e-12)


@pytest.mark.parametrize("name", ["complex", "simplified"])
def test_the_heading_goes_on_at_its_rate(name):
    gait = published_wave(ROBOT, 2.0, 50.0, 0.3).gait()
    runs = {"complex": Integrator(ROBOT, "complex"), "simplified": Integrator(ROBOT, "simplified")}
    source = runs.pop(name)
    (target,) = runs.values()
    state = source.integrate(Timeline.of_gait(gait, 1.31 * gait.period_s), source.rest()).final
    rates = []
    for run, begun in ((source, state), (target, target.adopt(state, source))):
        hair_s = 1e-6
        after = run.integrate(Timeline.of_gait(gait, hair_s), begun).final
        rates.append((after[HEADING] - begun[HEADING]) / hair_s)
    assert abs(rates[0]) > 0.1
    assert rates[1] == pytest.approx(rates[0], abs=1e-3)  # forces need time to change it


def test_a_rigid_snake_that_may_bend_from_now_on_keeps_its_angular_momentum():
    """The complex and the compliant model have the same momentum, and bends alike at first."""
    gait = published_wave(ROBOT, 2.0, 50.0, 0.3).gait()
    rigid, soft = Integrator(ROBOT, "complex"), Integrator(SOFT, "compliant")
    state = rigid.integrate(Timeline.of_gait(gait, 1.31 * gait.period_s), rigid.rest()).final
    assert soft.adopt(state, rigid)[YAW_MOMENTUM] == pytest.approx(state[YAW_MOMENTUM], rel=1e-9)


def test_models_that_agree_on_it_keep_every_bit():
    source, target = Integrator(ROBOT, "complex"), Integrator(ROBOT, "complex")
    state = np.linspace(-0.3, 0.4, source.states)
    state[6] = 0.0  # work is counted from here
    np.testing.assert_array_equal(target.adopt(state, source), state)

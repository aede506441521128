"""Every effect that enters the equations of motion works in the compliant model as in the complex one."""

import numpy as np
import pytest

from srs_opt.gait import Wave
from srs_opt.model.effects import all_effects
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.timeline import Timeline

GAIT = Wave.uniform(4, 2.0, 50.0, 1.2, 0.3).gait()


def _groups():
    """Effects by kind, actuators with and without a closed form apart: each group is compiled once."""
    groups = {}
    for name, effect in all_effects().items():
        if effect.in_equations or effect.delay is not None:
            kind = "nonlinear actuators" if effect.nonlinear_actuator else effect.kind
            groups.setdefault(kind, []).append(name)
    return groups


GROUPS = _groups()


def affected(names, larger=None, **changes):
    """The built-in robot with effects of half their typical size; one of them may be larger."""
    specs = []
    for name in names:
        first, *rest = all_effects()[name].parameters
        size = first.typical * (0.8 if name == larger else 0.5)
        specs.append({"name": name, first.name: size, **{p.name: p.typical for p in rest}})
    return wpi_srs().with_values(effects=specs, **changes)


def motion(robot, seconds=0.8):
    run = Integrator(robot)
    return run.run(Timeline.of_gait(GAIT, seconds), run.rest(0.1, -0.2, 0.3), 1e-6)


@pytest.mark.parametrize("kind", GROUPS)
def test_a_stiff_body_with_effects_moves_as_the_complex_model(kind):
    names = [n for n in GROUPS[kind] if all_effects()[n].flexibility is None]  # which would make it soft
    rigid = motion(affected(names))
    stiff = motion(affected(names, bending_stiffness_n_m2=100.0))
    way = np.abs(rigid.pose[-1] - rigid.pose[0]).max()
    np.testing.assert_allclose(stiff.pose[-1], rigid.pose[-1], atol=2e-3 * way)
    np.testing.assert_allclose(stiff.no_load[-1], rigid.kappa[-1], atol=2e-3)
    np.testing.assert_allclose(stiff.kappa[-1], rigid.kappa[-1], atol=2e-2)
    assert stiff.work_j[-1] == pytest.approx(rigid.work_j[-1], rel=5e-3)


@pytest.mark.parametrize(("kind", "name"), [(k, n) for k, names in GROUPS.items() for n in names])
def test_every_effect_has_its_say_in_a_soft_body(kind, name):
    usual, larger = (
        motion(affected(GROUPS[kind], one, bending_stiffness_n_m2=0.005)).pose[-1] for one in (None, name)
    )
    assert np.isfinite(larger).all()
    assert np.abs(larger - usual).max() > 1e-5


def test_steady_gaits_with_nonlinear_actuators():
    robot = affected(GROUPS["nonlinear actuators"], bending_stiffness_n_m2=0.005)
    orbit = steady_gait(robot, GAIT)
    run, period = Integrator(robot), GAIT.period_s
    path = run.run(Timeline.of_gait(GAIT, 25 * period), run.rest())
    start, end = path.pose[np.searchsorted(path.time_s, [24 * period - 1e-9, 25 * period - 1e-9])]
    way = np.hypot(*orbit.motion.displacement[:2])
    assert np.hypot(*(end - start)[:2]) == pytest.approx(way, rel=5e-3)

"""Every effect that enters the equations of motion works in the compliant model as in the complex one."""

import casadi as ca
import numpy as np
import pytest

from srs_opt.effects import all_effects
from srs_opt.gait import Wave
from srs_opt.model.bending_chain import BendingChain
from srs_opt.model.chain_derivatives import derivatives
from srs_opt.model.chambers import Drive
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
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
    return run.integrate(Timeline.of_gait(GAIT, seconds), run.rest(0.1, -0.2, 0.3), 1e-6)


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
    path = run.integrate(Timeline.of_gait(GAIT, 25 * period), run.rest())
    start, end = path.pose[np.searchsorted(path.time_s, [24 * period - 1e-9, 25 * period - 1e-9])]
    way = np.hypot(*orbit.motion.displacement[:2])
    assert np.hypot(*(end - start)[:2]) == pytest.approx(way, rel=5e-3)


@pytest.mark.parametrize("others", [[], [{"name": "gap_bending", "ratio": 0.4}]])
def test_derivatives_where_chambers_lengthen(others):
    """The recursions against CasADi's own derivatives, and the rate in time against a difference."""
    stretch = {"name": "chamber_stretch", "per_curv2": 4e-4}
    robot = wpi_srs().with_values(links=4, bending_stiffness_n_m2=0.005, effects=[stretch, *others])
    parameters, model, _ = build(Structure.of(robot))
    chain, p = BendingChain(model), parameters.vector
    y, dy, ddy = (ca.SX.sym(name, chain.size) for name in ("y", "dy", "ddy"))
    free, rate, acceleration, jerk = (ca.SX.sym(name, 3) for name in ("k", "dk", "ddk", "dddk"))
    drive = Drive(free, rate, ca.SX.zeros(3, 1), acceleration)
    g, power = chain.residual(y, dy, ddy, drive, ca.SX(1))
    d = derivatives(chain, y, dy, ddy, drive)
    ours = [d.mass.dense(), d.by_rate.dense(), d.by_place.dense(), d.power_by_rate, d.power_by_place]
    direct = [-ca.jacobian(g, ddy), ca.jacobian(g, dy), ca.jacobian(g, y)]
    direct += [ca.jacobian(power, dy), ca.jacobian(power, y)]
    in_time = ca.vertcat(*chain.rate_in_time(y, dy, ddy, drive, jerk))
    inputs = [y, dy, ddy, free, rate, acceleration, jerk, p]
    function = ca.Function("f", inputs, [*ours, *direct, in_time, ca.vertcat(g, power)])
    rng = np.random.default_rng(4)
    motion = [rng.normal(size=chain.size) * s for s in (0.4, 3, 50)]
    k = [rng.normal(size=3) * s for s in (12, 80, 500, 3000)]
    numbers = parameters.pack(robot, 50, 1)
    found = [np.asarray(v) for v in function(*motion, *k, numbers)]
    for own, exact in zip(found[:5], found[5:10]):
        np.testing.assert_allclose(own, exact, rtol=1e-9, atol=1e-11 * np.abs(exact).max())
    h, ends = 1e-6, []
    for s in (h, -h):
        later = [a + s * b + s * s / 2 * c for a, b, c in zip(k, k[1:], [*k[2:], 0 * k[3]])]
        ends.append(np.asarray(function(*motion, *later, k[3], numbers)[11]))
    difference = (ends[0] - ends[1]) / (2 * h)
    np.testing.assert_allclose(found[10], difference, rtol=1e-5, atol=1e-6 * np.abs(difference).max())

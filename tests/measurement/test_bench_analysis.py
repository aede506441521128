"""Bench tests: estimates against the truth, and their errors at the stated rate."""

import math

import numpy as np
import pytest
from measure_fixtures import ROBOT, binomial_allows
from scipy.integrate import solve_ivp

from srs_opt.errors import InputError
from srs_opt.measurement.actuator_bench import combine_steps
from srs_opt.measurement.checks import compare_checks
from srs_opt.measurement.records import Check, SpringCarTest, StepTest, TowTest
from srs_opt.measurement.spring_car import breakaway_friction
from srs_opt.measurement.steps import fit_step, fit_steps
from srs_opt.measurement.tow import analyse_tow
from srs_opt.model.actuator_law import step_response

TIME = np.arange(150) * 0.01


def taus(s, q):
    return s * (1 + math.sqrt(q)), s * (1 - math.sqrt(q))


@pytest.mark.parametrize("q", [0.0, 1e-9, 1e-4, 0.05, 0.4, 0.9])
def test_response_solves_the_equation_of_motion(q):
    one, two = taus(0.065, q)

    def rate(_, y):
        return [y[1], -(1 / one + 1 / two) * y[1] + (1 - y[0]) / (one * two)]

    exact = solve_ivp(rate, (0, 1.5), [0, 0], t_eval=TIME, rtol=1e-10, atol=1e-12, method="DOP853").y[0]
    assert np.allclose(step_response(TIME, 0.065, q), exact, atol=1e-8)


def make_step(q=0.05, c0=14.35, noise=0.15, seed=0, pressure=41.0, name="a", condition="ground", delay=0.0):
    rng = np.random.default_rng(seed)
    curvature = c0 * step_response(TIME - delay, 0.065, q) + noise * rng.normal(size=len(TIME))
    return StepTest(name, 1, condition, pressure, TIME, curvature)


@pytest.mark.parametrize("c0", [14.35, -14.35])
def test_exact_data_give_exact_constants(c0):
    fit = fit_step(make_step(noise=0.0, q=0.0533, c0=c0))
    assert fit.c0_1_m == pytest.approx(c0, rel=1e-6)
    assert (fit.tau1_s, fit.tau2_s) == pytest.approx(taus(0.065, 0.0533), rel=1e-3)


def test_delay_is_found_when_asked_for():
    fit = fit_step(make_step(noise=0.02, delay=0.03), fit_delay=True)
    assert abs(fit.delay_s - 0.03) < 4 * fit.delay_sd_s
    assert fit.delay_sd_s < 0.01


@pytest.mark.parametrize("q", [0.0, 0.05, 0.3])
def test_step_intervals_cover(q):
    hits = np.zeros(3, dtype=int)
    runs = 60
    one, two = taus(0.065, q)
    for seed in range(runs):
        fit = fit_step(make_step(q=q, seed=seed))
        hits += [
            abs(fit.c0_1_m - 14.35) < 1.645 * fit.c0_sd_1_m,
            fit.tau1_interval_s[0] < one < fit.tau1_interval_s[1],
            fit.tau2_interval_s[0] < two < fit.tau2_interval_s[1],
        ]
    assert all(binomial_allows(int(h), runs, 0.90) for h in hits), hits


def test_equal_time_constants_are_an_ordinary_case():
    fits = [fit_step(make_step(q=0.0, seed=seed)) for seed in range(30)]
    assert sum(f.equal for f in fits) >= 25
    assert all(np.isfinite([f.tau1_s, f.tau2_s, f.tau1_sd_s, f.tau2_sd_s]).all() for f in fits)
    assert not fit_step(make_step(q=0.3)).equal


def test_curvature_over_pressure():
    tests = []
    for seed, pressure in enumerate((41.0, 48.0, 55.0) * 2):
        for condition, factor in (("lifted", 1.08), ("ground", 1.0)):
            c0 = 0.35 * factor * pressure
            tests.append(make_step(c0=c0, pressure=pressure, seed=seed, condition=condition))
    bench = combine_steps(fit_steps(tests))
    for condition, factor in (("lifted", 1.08), ("ground", 1.0)):
        slope = bench.slope(condition)
        assert abs(slope.value - 0.35 * factor) < 4 * slope.sd
        found = bench.constants(condition)
        assert abs(found.tau1_s - taus(0.065, 0.05)[0]) < 4 * found.tau1_sd_s
        assert bench.constants(condition, 48.0).tests == 2
    assert all(c.lack_of_fit_p > 0.001 for c in bench.curvature)


def test_curvature_that_is_not_proportional_is_noticed():
    tests = [
        make_step(c0=0.35 * p * (1 - 0.01 * (p - 41)), pressure=p, seed=i)
        for i, p in enumerate((41, 46, 51, 56))
    ]
    assert combine_steps(fit_steps(tests)).curvature[0].lack_of_fit_p < 0.01


def test_scatter_between_segments_widens_the_error():
    rng = np.random.default_rng(0)
    tests = [make_step(c0=14.35 * (1 + 0.05 * rng.normal()), seed=i) for i in range(12)]
    slope = combine_steps(fit_steps(tests)).slope("ground")
    assert 0.5 < slope.scatter / (0.05 * 0.35) < 1.6
    assert slope.sd == pytest.approx(slope.scatter / math.sqrt(12), rel=0.1)


def test_too_few_samples():
    with pytest.raises(InputError, match="samples"):
        fit_step(StepTest("a", 1, "ground", 41.0, TIME[:3], TIME[:3]))
    with pytest.raises(InputError, match="no step tests"):
        combine_steps([])


def test_spring_car():
    tests = [SpringCarTest("tangential", 5.0, 0.1, d) for d in (0.008, 0.009, 0.0085)]
    found = breakaway_friction([*tests, SpringCarTest("normal", 50.0, 0.1, 0.0112)])
    values = [5 * d / 0.981 for d in (0.008, 0.009, 0.0085)]
    assert found["tangential"].mean == pytest.approx(np.mean(values))
    assert found["tangential"].sd == pytest.approx(np.std(values, ddof=1))
    assert found["tangential"].standard_error == pytest.approx(np.std(values, ddof=1) / math.sqrt(3))
    assert {f.kind for f in found.values()} == {"breakaway"}
    assert found["normal"].sd is None
    with pytest.raises(InputError, match="spring-car"):
        breakaway_friction([])


def test_tow():
    rng = np.random.default_rng(1)
    weight = 5 * 0.03 * 9.81
    tests = []
    for speed in (0.05, 0.1, 0.2, 0.4) * 4:
        for tether, extra in ((True, 0.035 + 0.25 * speed), (False, 0.0)):
            tests.append(TowTest(speed, 0.043 * weight + 0.1 * speed + extra + 5e-4 * rng.normal(), tether))
    found = analyse_tow(tests, ROBOT)
    assert abs(found.tether.coulomb_n - 0.035) < 4 * found.tether.coulomb_sd_n
    assert abs(found.tether.viscous_n_s_m - 0.25) < 4 * found.tether.viscous_sd_n_s_m
    assert abs(found.without_tether.viscous_n_s_m - 0.1) < 4 * found.without_tether.viscous_sd_n_s_m
    assert found.sliding.kind == "sliding"
    assert abs(found.sliding.mean - 0.043) < 4 * found.sliding.standard_error


def test_tow_with_little_to_go_by():
    found = analyse_tow([TowTest(0.1, 0.06, True)], ROBOT)
    assert found.with_tether.viscous_n_s_m is None
    assert found.with_tether.coulomb_sd_n is None
    assert found.sliding is None
    assert found.tether is None


def test_checks():
    found = compare_checks(
        [Check("ruler_scale", 1.03, 0.01), Check("moon", 3, 1), Check("tail_load_n", 0.2943, 0)], ROBOT
    )
    assert found[0].deviations == pytest.approx(3)
    assert found[1].expected is None
    assert found[2].expected == pytest.approx(0.2943)
    assert found[2].deviations is None

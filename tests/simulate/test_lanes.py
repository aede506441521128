"""The vector code against the interpreter, and that company, compiler flags and processor change no bit."""

import casadi as ca
import numpy as np
import pytest

from srs_opt.gait import Wave, published_wave
from srs_opt.model.parameters import Structure
from srs_opt.orbit.steady import Orbit, steady_gait, steady_gaits
from srs_opt.robot import wpi_srs
from srs_opt.simulate import compiled, kernel, lanes
from srs_opt.simulate.batched import run_batched
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.kernel import Course, Kernel
from srs_opt.simulate.lanes import step_source
from srs_opt.simulate.rosenbrock import step_function
from srs_opt.simulate.timeline import Timeline


def toy():
    """Every function that the models may use, far into its range."""
    x, v, h, p = ca.SX.sym("x", 3), ca.SX.sym("v", 2), ca.SX.sym("h"), ca.SX.sym("p", 2)
    a, b = x[0] * p[0], v[0] * p[1] + h
    terms = [
        ca.sin(a), ca.cos(50 * a), ca.tanh(b), ca.tanh(400 * b), ca.exp(-ca.fabs(3 * b)), ca.sinh(a),
        ca.cosh(a), ca.sqrt(a * a + 1), ca.fmin(a, b), ca.fmax(a, b), ca.if_else(a < b, a, -b), ca.sign(b),
        ca.atan2(a, b), ca.log(1 + a * a), (1 + a * a) ** 0.7, ca.if_else(ca.logic_and(a > 0, b > 0), 1, 0),
        ca.exp(5 * ca.tanh(a)), a / (b + 9), b / (b + 9), ca.atan(a), ca.floor(a),
    ]  # fmt: skip
    total = sum(t * (k + 1) ** 0.5 for k, t in enumerate(terms))
    following = ca.vertcat(0.3 * x[0] + ca.sin(total), ca.tanh(x[1] + b * v[1]), x[2] + h)
    return ca.Function("toy", [x, v, h, p], [following, total], {"cse": True})


def courses(rng, lanes, n=40):
    found = []
    for k in range(lanes):
        steps = n - 7 * k
        h, valve = rng.uniform(0, 0.1, steps), rng.normal(size=(steps, 2))
        found.append(Course(rng.normal(size=3), h, valve, rng.normal(size=2)))
    return found


@pytest.fixture
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SRS_OPT_CACHE", str(tmp_path))
    return tmp_path


@pytest.mark.skipif(compiled.compiler() is None, reason="needs a C compiler")
@pytest.mark.parametrize("part", [5, 2000])
def test_vectors_agree_with_the_interpreter(own_cache, monkeypatch, part):
    monkeypatch.setattr(lanes, "PART", part)  # a function per few operations, or one for all
    fast = Kernel("toy", (3, 2, 2), toy)
    monkeypatch.setattr(compiled, "compiler", lambda: None)
    slow = Kernel("toy", (3, 2, 2), toy)
    assert fast._run is not None
    assert slow._run is None
    rng = np.random.default_rng(0)
    for _ in range(200):  # single steps: the toy is chaotic
        work = [c for k in range(4) for c in courses(rng, 1, n=1)]
        (x, error), (x_slow, error_slow) = fast.run(work), slow.run(work)
        np.testing.assert_allclose(error, error_slow, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(x, x_slow, atol=1e-11)
    long = courses(rng, 3)
    assert fast.run(long)[0].shape == slow.run(long)[0].shape == (40, 3, 3)
    assert fast.run(long, keep=False)[0].shape == slow.run(long, keep=False)[0].shape == (1, 3, 3)


@pytest.mark.skipif(compiled.compiler() is None, reason="needs a C compiler")
def test_neither_company_nor_flags_change_a_bit(own_cache, monkeypatch):
    work = courses(np.random.default_rng(1), 4)
    results = []
    for flags in (kernel._FLAGS, (*kernel._FLAGS, "-O3"), kernel._flags()):
        monkeypatch.setattr(kernel, "_flags", lambda flags=flags: flags)
        k = Kernel("toy", (3, 2, 2), toy)
        results.append(
            [k.run(work)[0][..., 2], k.run([work[2], work[0]])[0][..., 0], k.run([work[2]])[0][..., 0]]
        )
        assert np.array_equal(k.run(work, keep=False)[0][0], k.run(work)[0][-1])
    n = work[2].h_s.size
    for alternatives in results:
        for found in alternatives:
            assert np.array_equal(found[:n], results[0][0][:n])


def test_shared_divisors_become_one_division():
    source = step_source(toy(), "toy", 4)
    assert source.count("= 1 / t") == 1


def test_the_models_step_agrees_with_the_interpreter():
    run = Integrator(wpi_srs())
    step = step_function(Structure.of(wpi_srs()))
    gait = published_wave(wpi_srs(), 2, 55, 0.4).gait()
    p = run.pack(55, 2)
    path = run.integrate(Timeline.of_gait(gait, 0.7), run.rest())
    x, valve = path.final, gait.valve(0.2)
    (got, error) = run.kernel.run([Course(x, np.full(3, 2e-3), np.tile(valve, (3, 1)), p)])
    for k in range(3):
        x, e = (np.asarray(v).ravel() for v in step(x, valve, 2e-3, p))
        np.testing.assert_allclose(got[k, :, 0], x, rtol=1e-11, atol=1e-13)
        np.testing.assert_allclose(error[k, 0], e[0], rtol=1e-5, atol=1e-12)


def test_gaits_side_by_side_are_the_same_as_alone():
    gaits = [Wave.uniform(4, f, p, 1.1, o).gait() for f in (1.1, 1.9) for p in (43, 55) for o in (0, 0.5)]
    longer = [*gaits, *gaits[::-1]] * 7
    for a, b in zip(steady_gaits(wpi_srs(), longer), steady_gaits(wpi_srs(), longer, jobs=2), strict=True):
        assert np.array_equal(a.pose, b.pose)
    for together_, gait in zip(steady_gaits(wpi_srs(), gaits), gaits):
        assert isinstance(together_, Orbit)
        own = steady_gait(wpi_srs(), gait)
        assert own.speed_m_s == together_.speed_m_s
        assert np.array_equal(own.pose, together_.pose)


def test_simulations_side_by_side_are_the_same_as_alone():
    run = Integrator(wpi_srs())
    lines = [
        Timeline.of_gait(Wave.uniform(4, f, 50, 1.2, 0.2).gait(), 1.5 + f) for f in (1, 1.3, 1.6, 1.8, 2)
    ]
    paths = run_batched([run.travel(line, run.rest()) for line in lines])
    for path, line in zip(paths, lines):
        assert np.array_equal(path.pose, run.integrate(line, run.rest()).pose)


def test_searches_that_want_nothing_do_not_stop_the_others():
    def idle(k):
        return k
        yield

    assert run_batched([idle(k) for k in range(100)]) == list(range(100))
    assert run_batched([]) == []

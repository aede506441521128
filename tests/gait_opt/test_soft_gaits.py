"""Gaits of soft bodies: bends are collocated, and the optimum holds when simulated from rest."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from test_collocation import derivative_errors, held_gait

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Wave, published_wave
from srs_opt.gait_opt import finish, from_rest
from srs_opt.gait_opt.collocation.guess import unknowns_from_orbits
from srs_opt.gait_opt.collocation.layout import Mesh
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.continuation import Stage, Step, orbits_of, run_stages
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.robust import of_stiffness, relative, stiffness_interval
from srs_opt.gait_opt.score import score
from srs_opt.gait_opt.search_settings import FROM_REST
from srs_opt.gait_opt.softness import robust_gait
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs

SOFT = wpi_srs().with_values(bending_stiffness_n_m2=0.005, friction_speed_m_s=0.001)


def problem(robot, **changes):
    return CycleProblem((robot,), "compliant", Goal(**changes), Limits())


def test_derivatives_of_the_bends_equations():
    short = SOFT.with_values(links=3, friction_speed_m_s=0.1)
    gait = Wave(1.7, 47.0, (0.3, 1.5), (0.1, -0.2)).gait()
    case, mesh = problem(short), Mesh.uniform(16)
    p = case.program(16)
    z, scales = unknowns_from_orbits(p.layout, [short], [steady_gait(short, gait)], mesh)
    first, second = derivative_errors(p, z, case.parameters(p, mesh, scales, 0.1))
    assert first < 1e-6
    assert second < 1e-5


def test_collocated_bends_converge_to_the_simulated_orbit():
    smooth = replace(SOFT, friction_speed_m_s=0.03)
    gait = Wave(1.9, 43.0, (0.0, 1.1, 2.18, 2.85), (0.0, 0.1, 0.0, 0.0)).gait()
    orbit = steady_gait(smooth, gait)
    case = problem(smooth, objective="turn", turn_rate_rad_s=orbit.turn_rate_rad_s)
    errors = []
    for elements in (12, 48):
        p, z, scales = held_gait(case, orbit, elements)
        errors.append(abs(z[p.layout.unknown(0, "speed")] / orbit.speed_m_s - 1))
        bends = z[p.layout.states(0)].reshape(p.layout.points, -1)[:, 6:10] * scales[0][6:10]
    assert errors[1] < 1e-4
    assert errors[1] < errors[0] / 3
    assert np.abs(bends).max() == pytest.approx(np.abs(orbit.kappa).max(), rel=0.02)


def test_optimum_of_a_soft_body_from_the_published_gait():
    """The best that a population search of another program knows at 0.005 N m^2 is 0.519 m/s."""
    start = published_wave(SOFT, 2.0, 48.0).gait()
    stages = (*(Stage(v, n, 0.1, 4, quick=True) for v, n in ((0.1, 24), (0.03, 28), (0.01, 36))),
             Stage(0.004, 50, 0.05, 1, quick=True))  # fmt: skip
    found = run_stages(problem(SOFT), start, stages)
    assert found.score.total > 0.97 * 0.519
    lags = np.diff([on for ((on, _),) in found.gait.intervals]) / found.gait.period_s % 1.0
    tail, _, head = -2 * np.pi * (lags - 1)
    assert tail > 1.0 > 0.75 > head  # softer bodies: longer at the tail, shorter at the head


STIFFNESSES = (0.002, 0.005, 0.02)


def test_packaged_robust_gait_runs_twice_as_fast_as_the_published_one_whatever_the_stiffness():
    """Another program knows a gait with 0.470, 0.486 and 0.474 m/s: 1.97 times the published one."""
    robots = [of_stiffness(SOFT, ei) for ei in STIFFNESSES]
    speeds = np.array([steady_gait(robot, robust_gait()).speed_m_s for robot in robots])
    published = [steady_gait(r, published_wave(r, 2.0, 55.0).gait()).speed_m_s for r in robots]
    assert (speeds > [0.470, 0.486, 0.474]).all()
    assert (speeds / published).min() > 1.97


def test_relative_merit_is_that_of_the_robot_slowest_beside_its_published_gait():
    gait = Wave.uniform(4, 2.0, 41.0, 0.9).gait()
    case = CycleProblem(tuple(of_stiffness(SOFT, ei) for ei in (0.005, 0.02)), "compliant", Goal(), Limits())
    orbits = orbits_of(case, gait)
    speeds = [o.speed_m_s for o in orbits]  # 0.404 and 0.520 m/s, published 0.246 and 0.233
    assert score(case, gait, orbits).merit == pytest.approx(min(speeds))
    weighted = relative(case)
    assert weighted.weights == pytest.approx((1.0, 0.246 / 0.233), rel=0.01)
    assert score(weighted, gait, orbits).merit == pytest.approx(speeds[0])
    slower = (replace(orbits[0], motion=replace(orbits[0].motion, speed_m_s=0.5)), orbits[1])
    other = replace(weighted, weights=(1.0, 0.8))
    assert score(other, gait, slower).merit == pytest.approx(0.8 * speeds[1])


def test_a_stiffness_known_with_a_deviation_stands_for_its_interval():
    robots = stiffness_interval(SOFT.with_values(relative_sd={"bending_stiffness_n_m2": 0.2}))
    assert [r.bending_stiffness_n_m2 for r in robots] == pytest.approx(
        [0.005, 0.005 * np.exp(-0.4), 0.005 * np.exp(0.4)]
    )
    assert stiffness_interval(SOFT) == (SOFT,)
    assert stiffness_interval(wpi_srs()) == (wpi_srs(),)


def test_search_from_rest_gains_on_ticks_inside_the_limits(monkeypatch):
    monkeypatch.setattr(from_rest, "FROM_REST", replace(FROM_REST, generations=4))
    start = Wave(1.99, 46.0, (0.0, 1.2, 2.15, 2.75), (0.0,) * 4).gait()
    case = problem(SOFT.with_values(bending_stiffness_n_m2=0.002))
    found = from_rest.search_from_rest(case, start, seed=3)
    assert found.evaluations == 1 + 4 * FROM_REST.members
    assert found.after > found.before + 0.05
    assert score(case, found.gait, orbits_of(case, found.gait)).total == pytest.approx(found.after)
    assert 1.0 <= found.gait.frequency_hz <= 2.0 + 1e-9
    assert 41.0 <= found.gait.pressure_kpa <= 55.0
    ticks = np.array([t for pairs in found.gait.intervals for pair in pairs for t in pair]) / 0.001
    assert ticks == pytest.approx(np.round(ticks), abs=1e-6)
    again = from_rest.search_from_rest(case, start, seed=3)
    assert again.gait == found.gait


@pytest.mark.parametrize(
    ("steady_m_s", "standing_m_s", "stands"),
    [(0.2, 0.199, True), (0.2, 0.197, False), (-0.2, -0.199, True), (-0.2, -0.197, False), (4e-4, 0.0, True)],
)
def test_a_standing_start_is_judged_alike_forwards_backwards_and_turning_in_place(
    monkeypatch, steady_m_s, standing_m_s, stands
):
    monkeypatch.setattr(from_rest, "orbits_of", lambda *_: (SimpleNamespace(speed_m_s=steady_m_s),))
    monkeypatch.setattr(from_rest, "standing_start", lambda *_: standing_m_s)
    assert from_rest._stands(problem(SOFT), robust_gait()) == stands


def test_orbits_that_rest_does_not_reach_are_noticed():
    step = Step(Stage(0.002, 80, 0.1), 0.5, 0.5, 10, astray=0.01)
    assert not from_rest.misled([step])
    assert from_rest.misled([step, replace(step, astray=0.2)])


def test_what_was_given_is_kept_where_no_better_gait_has_a_steady_motion(monkeypatch):
    """As found at 0.0015 N m²: a millisecond beside a good gait the motion no longer repeats."""

    def lost(*arguments):
        raise NoAnswerError("the motion does not repeat with the gait's period")

    monkeypatch.setattr(finish, "optimize_switch_times", lost)
    rigid = CycleProblem((wpi_srs(),), "complex", Goal("speed"), Limits())
    gait = published_wave(wpi_srs(), 2.0, 55.0).gait()
    exact, certificate, orbits = finish.finished(rigid, gait, 0.02)
    assert exact.gait == orbits[0].gait == finish.rounded(rigid, gait)
    assert certificate.passed

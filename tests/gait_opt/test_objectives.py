"""An objective is written once: program and simulation agree on it; sides, floors and robots are checked."""

import pickle
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from srs_opt.errors import InputError
from srs_opt.gait import Wave, published_wave
from srs_opt.gait_opt import search as search_module
from srs_opt.gait_opt.certificate import certify
from srs_opt.gait_opt.collocation.guess import gait_from, unknowns_from_orbits
from srs_opt.gait_opt.collocation.layout import Mesh
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.collocation.solver import Solver
from srs_opt.gait_opt.continuation import Stage, orbits_of, solve_from
from srs_opt.gait_opt.corrections import on_ticks
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.objectives.objective import Objective
from srs_opt.gait_opt.objectives.registry import OBJECTIVES, objective_named, register_objective
from srs_opt.gait_opt.optimize import optimize_gait
from srs_opt.gait_opt.prices import prices
from srs_opt.gait_opt.score import evaluated, score
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs

ROBOT = wpi_srs()
LEFT = Wave(1.7, 47.0, (0.3, 1.2, 1.95, 2.9), (0.35, 0.3, 0.35, 0.3)).gait()


def problem(goal: Goal, robots=(ROBOT,)) -> CycleProblem:
    return CycleProblem(robots, "complex", goal, Limits())


def bend(cycle):
    """Least mean square curvature, of all that an objective may look at."""
    late = ca.sum1(ca.sum2(cycle.off - cycle.on)) / cycle.on.numel()
    return -ca.sumsqr(cycle.curvature_1_m) / cycle.curvature_1_m.numel() / 100 - late


def at_least_slow(cycle):
    return 0.05, cycle.speed_m_s, 0.3


OWN = Objective("bend", bend, constraints=(at_least_slow, lambda cycle: 0.3 - cycle.band_m), turn="any")


@pytest.mark.parametrize("objective", [*OBJECTIVES.built_in.values(), OWN], ids=lambda o: o.name)
def test_program_and_simulation_see_the_same_merit(objective):
    case = problem(Goal(objective, speed_m_s=0.01 if objective.needs_speed else None))
    smooth = replace(ROBOT, friction_speed_m_s=0.1)
    orbit, mesh = steady_gait(smooth, LEFT), Mesh.uniform(24)
    p = case.program(24)
    z, scales = unknowns_from_orbits(p.layout, [ROBOT], [orbit], mesh)
    rows = np.asarray(p.evaluate(z, case.parameters(p, mesh, scales, 0.1))).ravel()[-len(p.goal.names) :]
    seen = dict(zip(p.goal.names, rows))
    merit, own = evaluated(case, case.goal.aim, LEFT, 0, orbit)
    assert seen["merit"] + z[p.layout.merit] == pytest.approx(merit, rel=2e-3)
    if objective is OWN:
        assert seen["at_least_slow"] == pytest.approx(own[0], rel=1e-3)
        assert seen["<lambda>"] == pytest.approx(own[1], rel=1e-6)


@pytest.mark.parametrize("name", ["turn", "pivot"])
def test_a_turn_to_the_other_side_never_wins(name):
    right = LEFT.mirrored()
    for side, good, bad in (("left", LEFT, right), ("right", right, LEFT)):
        case = problem(Goal(name, side=side))
        best, other = (score(case, g, (steady_gait(ROBOT, g),)) for g in (good, bad))
        assert best.miss == 0
        assert best.total > other.total + 0.01
        claim = (steady_gait(ROBOT, bad).speed_m_s,)
        assert any(f"should turn {side}" in f for f in certify(case, on_ticks(bad, 0.001), claim)[0].failures)


def test_every_wish_is_checked_on_every_robot():
    slippery = ROBOT.with_values(friction_normal=0.3, friction_tangential=0.15)
    slippery = replace(slippery, name="slippery")
    gait = on_ticks(LEFT, 0.001)
    orbits = [steady_gait(r, gait) for r in (ROBOT, slippery)]
    goal = Goal("turn", radius_m=orbits[0].radius_m, speed_m_s=0.9 * orbits[0].speed_m_s)
    certificate, _ = certify(problem(goal, (ROBOT, slippery)), gait, tuple(o.speed_m_s for o in orbits))
    assert not certificate.passed
    assert certificate.worst_robot.name == "slippery"
    assert all("robot 'slippery'" in failure for failure in certificate.failures)
    words = " ".join(certificate.failures)
    assert "wanted radius" in words and "wanted speed" in words
    assert certify(problem(goal), gait, (orbits[0].speed_m_s,))[0].passed


def test_a_constraint_that_is_missed_fails_the_certificate():
    gait = on_ticks(LEFT, 0.001)
    speed = steady_gait(ROBOT, gait).speed_m_s
    fast = replace(OWN, constraints=(lambda cycle: cycle.speed_m_s - 0.5,))
    assert any("constraint <lambda>" in f for f in certify(problem(Goal(fast)), gait, (speed,))[0].failures)


def test_objectives_travel_and_are_known_by_name():
    again = pickle.loads(pickle.dumps(OWN))
    assert again == OWN
    assert again.merit is not None
    slim = OBJECTIVES.built_in["slim"]
    assert pickle.loads(pickle.dumps(slim)) == slim
    known = register_objective(Objective("least_bend", bend))
    assert objective_named("least_bend") is known
    with pytest.raises(InputError, match="registered before"):
        register_objective(Objective("least_bend", at_least_slow))
    with pytest.raises(InputError, match="exists already"):
        register_objective(Objective("speed", bend))


@pytest.mark.parametrize(
    ("merit", "word"),
    [
        (lambda cycle: cycle.on, "one number"),
        (lambda cycle: "fast", "CasADi expression"),
        (lambda cycle: cycle.velocity, "fails: AttributeError"),
    ],
)
def test_formulas_that_are_none_are_refused(merit, word):
    with pytest.raises(InputError, match=word):
        _ = problem(Goal(Objective("odd", merit))).formulas


@pytest.fixture(scope="module")
def optimum():
    """Case, gait, stage, solution and program of an optimum at smoothed friction."""
    case = replace(problem(Goal()), limits=Limits(pressure_kpa=(41.0, 43.0)))
    stage = Stage(0.03, 24, 0.3, 1)
    start = published_wave(ROBOT, 2.0, 41.0).gait()
    for _ in range(3):
        solution, p, _ = solve_from(case, start, orbits_of(case, start, 0.03), stage, 0.3)
        start = gait_from(p.layout, solution.z)
    return case, start, stage, solution, p


def test_prices_of_limits_are_what_a_step_brings(optimum):
    case, gait, stage, solution, p = optimum
    orbits = orbits_of(case, gait, 0.03)
    worth = score(case, gait, orbits).scale
    told = {price.limit: price for price in prices(case, p, solution, worth)}
    assert "the highest frequency raised by 0.1 Hz would buy" in told["the highest frequency"].words
    for limit, changed, share in (
        ("the highest pressure", Limits(pressure_kpa=(41.0, 43.2)), 0.2),
        ("the highest frequency", Limits((1.0, 2.02), (41.0, 43.0)), 0.2),
    ):
        again, q, _ = solve_from(replace(case, limits=changed), gait, orbits, stage, 0.3)
        gained = worth * (again.z[q.layout.merit] - solution.z[p.layout.merit])
        assert gained == pytest.approx(share * told[limit].merit, rel=0.1)


def test_other_solvers_take_the_same_program(optimum):
    case, gait, stage, *_ = optimum
    orbits = orbits_of(case, gait, 0.03)
    short = Solver("sqpmethod", (("max_iter", 2),))
    other, _, _ = solve_from(replace(case, solver=short), gait, orbits, stage, 0.3)
    assert not other.converged
    assert np.isfinite(other.z).all()
    one = Solver.of_words("ipopt", ["max_iter=1"])
    assert solve_from(replace(case, solver=one), gait, orbits, stage, 0.3)[0].iterations == 1
    with pytest.raises(InputError, match="solver ipopt with options fly=1"):
        solve_from(replace(case, solver=Solver.of_words("ipopt", ["fly=1"])), gait, orbits, stage, 0.3)
    with pytest.raises(InputError, match="KEY=VALUE"):
        Solver.of_words("ipopt", ["fly"])
    with pytest.raises(InputError, match="solver must be"):
        Solver("snopt")


def test_an_objective_of_ones_own_is_optimized(monkeypatch):
    """Least pressure at a least speed: the constraint is active in the simulated motion."""
    monkeypatch.setattr(
        search_module, "continuation_stages", lambda own_m_s, **how: (Stage(0.03, 28, 0.1, 2),)
    )

    def gentle(cycle):
        return -cycle.pressure_kpa / 50

    def fast_enough(cycle):
        return 0.2, cycle.speed_m_s, 0.6

    found = optimize_gait(ROBOT, gentle, [fast_enough], limits=Limits(pressure_kpa=(10.0, 55.0)), starts=1)
    assert found.certificate.passed, found.certificate.failures
    assert found.gait.pressure_kpa < 35
    assert found.certificate.speed_m_s == pytest.approx(0.2, abs=0.012)
    assert any("constraint fast_enough" in price.words for price in found.prices)

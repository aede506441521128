"""The grammar's terms: effects that say in words what they do."""

import casadi as ca
import numpy as np
import pytest

from srs_opt.calibrate.forms import forms_of
from srs_opt.calibrate.model import Conditions, Model
from srs_opt.effects import all_effects, generic_effects, known_effects
from srs_opt.effects.generic import TERMS
from srs_opt.effects.parameter import Component
from srs_opt.gait import Wave
from srs_opt.gait_opt.collocation.point import PointKind, _linear_curvature, _Symbols
from srs_opt.model.parameters import Structure, room_effects
from srs_opt.model.registry import build
from srs_opt.robot import load_robot, save_robot, wpi_srs

GAIT = Conditions(50.0, 2.0)
NAMES = list(TERMS)


def entry_of(name, share=1.0):
    effect = known_effects()[name]
    found = {p.name: p.typical for p in effect.parameters}
    found |= {p.name: share * p.typical for p in effect.parameters if p.name == effect.size.name}
    found |= {p.name: share * p.typical for p in effect.parameters if isinstance(p, Component)}
    return {"name": name, **found, **({effect.place.name: 2} if effect.place else {})}


def robot_with(*entries):
    return wpi_srs().with_values(effects=list(entries))


def rate_of(robot, way=1):
    """Return the rates in a state, or the one with all going the other way; an effect's own state is 1/2."""
    structure = Structure.of(robot)
    parameters, m, actuator = build(structure)
    pose, velocity = ca.SX.sym("pose", 3), ca.SX.sym("velocity", 3)
    rate = m.velocity_rate(pose, velocity)[0]
    act = ca.SX.sym("act", actuator.states)
    valve = ca.SX([way, -way, 0, way])
    rates = actuator.rates(actuator.unstack(act), valve).vector()[: 2 * structure.segments]
    inputs = [pose, velocity, m.kappa, m.dkappa, m.time, act, parameters.vector]
    f = ca.Function("f", inputs, [rate, rates])
    rng = np.random.default_rng(0)
    kappa, dkappa = 10 * rng.standard_normal(4), 20 * rng.standard_normal(4)
    state = np.full(actuator.states, 0.5)
    state[:8] = [*kappa, *dkappa]
    moving = [0.2 * way, -0.1 * way, 2e-5]
    found = f([0.3, 0.2, 0.4], moving, kappa, dkappa, 1.0, state, parameters.pack(robot, 45.0, 2.0))
    return np.concatenate([np.asarray(v).ravel() for v in found])


def test_no_term_has_the_name_of_a_listed_effect_and_none_is_searched_first():
    assert not set(generic_effects()) & set(all_effects())
    assert not [f for f in Model(wpi_srs()).forms if f.effect.name in TERMS]


@pytest.mark.parametrize("name", NAMES)
def test_a_term_is_absent_at_size_zero_and_acts_at_its_typical_size(name):
    plain, absent, there = wpi_srs(), robot_with(entry_of(name, 0.0)), robot_with(entry_of(name))
    assert Structure.of(absent) == Structure.of(plain)
    effect = TERMS[name].effect
    if effect.in_equations:
        change = [np.abs(rate_of(there, w) - rate_of(plain, w)) / np.abs(rate_of(plain, w)) for w in (1, -1)]
        assert np.max(change) > 1e-3
        small = rate_of(robot_with(entry_of(name, 1e-9)))
        assert small[:11] == pytest.approx(rate_of(plain)[:11], rel=1e-6, abs=1e-6)


@pytest.fixture(scope="module")
def generic():
    return Model(wpi_srs(), generic=True)


@pytest.mark.parametrize("name", NAMES)
def test_the_packing_moves_with_every_coordinate(generic, name):
    for form in forms_of(TERMS[name].effect, 5):
        seeds = generic.seeds({}, GAIT, form.sizes)
        parts = (seeds.p, seeds.camera, seeds.delay_s, seeds.clock_s, seeds.clock_rate, seeds.marker_lag_s)
        assert np.all(sum(np.abs(v).sum(axis=0) for v in parts) > 0)


@pytest.mark.parametrize("name", NAMES)
def test_a_robot_file_holds_it_and_words_say_it(tmp_path, name):
    entry = entry_of(name)
    robot = load_robot(save_robot(robot_with(entry), tmp_path / "robot.yaml"))
    assert dict(robot.effects[0]) == pytest.approx(entry)
    words = TERMS[name].sentence(entry, {})
    assert "{" not in words and len(words) > 20
    if TERMS[name].effect.timed:
        assert room_effects(robot) == [name]  # gaits leave out what has no period


def test_sizes_are_told_to_the_digits_that_their_deviation_leaves():
    entry = {"name": "generic_along_link", "excess": 4.955, "link": 2}
    said = TERMS["generic_along_link"].sentence(entry, {"excess": 0.035})
    assert said == "link 2 rolls 5.955 ± 0.035 times as hard as the others"
    entry = {"name": "generic_mass_link", "extra_kg": -0.0398, "link": 3}
    assert TERMS["generic_mass_link"].sentence(entry, {"extra_kg": 1e-4}) == (
        "link 3 is 39.80 ± 0.10 g lighter than the others"
    )


def test_a_wheel_that_rolls_hard_is_as_good_as_a_coefficient_of_its_own():
    """All five links together are the robot with another coefficient."""
    entries = [{"name": "generic_along_link", "excess": 1.0, "link": k} for k in range(1, 6)]
    twice = wpi_srs().with_values(friction_tangential=2 * wpi_srs().friction_tangential)
    assert rate_of(robot_with(*entries)) == pytest.approx(rate_of(twice), rel=1e-12)


def test_a_factor_on_friction_leaves_viscous_forces_alone_whichever_effect_comes_first():
    factor = {"name": "generic_along_body", "gradient": 0.8}
    for viscous in (entry_of("viscous_rolling"), entry_of("generic_along_speed_link")):
        added = rate_of(robot_with(factor, viscous)) - rate_of(robot_with(factor))
        alone = rate_of(robot_with(viscous)) - rate_of(wpi_srs())
        assert added == pytest.approx(alone, rel=1e-9, abs=1e-12)


def test_friction_that_grows_with_time_is_a_coefficient_that_does():
    for name, own in (("along", "friction_tangential"), ("across", "friction_normal")):
        late = robot_with({"name": f"generic_{name}_time", "per_s": 0.3})  # one second after the start
        grown = wpi_srs().with_values(**{own: 1.3 * getattr(wpi_srs(), own)})
        assert rate_of(late) == pytest.approx(rate_of(grown), rel=1e-12)


def test_a_late_chamber_gets_the_rest_of_its_pressure_with_its_lag():
    """All of it: the target after t is 1 - exp(-t/lag) of the pressure's; the other side is in time."""
    entry = {"name": "generic_lag_left_segment", "ratio": 1.0, "lag_s": 0.05, "segment": 1}
    robot = robot_with(entry)
    parameters, _, actuator = build(Structure.of(robot))
    x, valve, time = ca.SX.sym("x", actuator.states), ca.SX.sym("valve", 4), ca.SX.sym("time")
    after = actuator.advance(actuator.unstack(x), valve, time)
    f = ca.Function("f", [x, valve, time, parameters.vector], [after.vector(), actuator.target(valve, after)])
    p, state = parameters.pack(robot, 50.0, 2.0), np.zeros(actuator.states)
    whole = robot.curvature_per_pressure_1_m_kpa * 50.0
    for _ in range(100):
        state, target = (np.asarray(v).ravel() for v in f(state, np.ones(4), 1e-3, p))
    assert target == pytest.approx([whole * (1 - np.exp(-2)), whole, whole, whole], rel=1e-6)
    assert np.asarray(f(state, -np.ones(4), 1e-3, p)[1]).ravel() == pytest.approx(np.full(4, -whole))


@pytest.mark.parametrize("name", ["generic_gain_neighbours", "generic_gain_side", "generic_gain_segment"])
def test_the_closed_form_of_gait_optimization_is_the_actuators_cycle(name):
    robot, gait = robot_with(entry_of(name)), Wave.uniform(4, 2.0, 50.0, 1.1, 0.2).gait()
    structure = Structure.of(robot)
    parameters, _, actuator = build(structure)
    kind = PointKind(structure)
    s = _Symbols.of(kind)
    kappa, rate, _ = _linear_curvature(kind, s)
    closed = ca.Function("closed", [s.at, s.switches, s.half_width, parameters.vector], [kappa, rate])
    p = parameters.pack(robot, gait.pressure_kpa, 1 / gait.period_s)
    on, off = np.array([pairs[0] for pairs in gait.intervals]).T / gait.period_s
    off = np.where(off < on, off + 1, off)
    found = closed(0.0, np.ravel(np.column_stack([on, off])), 1e-4, p)
    act, valve, time = ca.SX.sym("act", actuator.states), ca.SX.sym("valve", 4), ca.SX.sym("time")
    after = actuator.advance(actuator.unstack(act), valve, time).vector()
    step = ca.Function("step", [act, valve, time, parameters.vector], [after])
    state = np.zeros(actuator.states)
    durations, valves = gait.phases()
    for _ in range(30):
        for duration, held in zip(durations, valves.T):
            state = step(state, held, duration, p)
    expected = np.asarray(state).ravel()
    assert np.asarray(found[0]).ravel() == pytest.approx(expected[:4], abs=2e-3)

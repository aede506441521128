"""Every effect against its definition in plain numpy at random states; sizes, bounds, refusals."""

import casadi as ca
import numpy as np
import oracle_snake as oracle
import pytest

from srs_opt.document import Document
from srs_opt.effects import all_effects
from srs_opt.errors import InputError
from srs_opt.gait import published_wave
from srs_opt.model.actuator import ActuatorState
from srs_opt.model.parameters import Structure, room_effects, valve_delay_s
from srs_opt.model.registry import build
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import robot_from_document, wpi_srs
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.timeline import Timeline

LISTED = {
    "tether_drag": {"force_n": 0.035},
    "tether_viscous": {"damping": 0.25},
    "tether_pull": {"force_n": 0.03, "ax_m": 1.5, "ay_m": -2.0},
    "tether_weight": {"load_n": 0.20},
    "gap_length": {"extra_m": 0.008},
    "gap_bending": {"ratio": 0.6},
    "bending_resistance": {"ratio": 0.18},
    "curvature_bias": {"bias": 1.2},
    "segment_bias": {"bias": 3.0, "segment": 2},
    "dead_time": {"delay_s": 0.03},
    "fill_exhaust_asymmetry": {"ratio": 0.5},
    "supply_droop": {"per_hz": 0.10},
    "curvature_stiffening": {"per_curv2": 6e-4},
    "hysteresis": {"ratio": 0.35, "width": 4.0},
    "viscous_rolling": {"damping": 0.06},
    "stribeck": {"excess": 1.0, "speed": 0.08},
    "slip_rate": {"per_speed": 8.0},
    "floor_slope": {"angle": 0.006, "direction": 0.7},
    "head_mass": {"extra_kg": 0.02},
    "wheel_toe": {"angle": 0.03},
    "single_wheel_toe": {"angle": 0.10, "link": 4},
    "marker_offset": {"dx_m": 0.004, "dy_m": 0.004},
    "camera_scale": {"scale": 0.03},
    "camera_tilt": {"per_m": 0.03},
    "clock_offset": {"offset_s": 0.03},
}
MECHANICAL = [name for name in LISTED if all_effects()[name].kind in ("tether", "room", "body", "ground")]
ACTUATION = [name for name in LISTED if all_effects()[name].kind == "actuation"]
NOT_BELOW_ZERO = [
    "tether_drag",
    "tether_viscous",
    "tether_pull",
    "tether_weight",
    "bending_resistance",
    "dead_time",
    "supply_droop",
    "hysteresis",
    "viscous_rolling",
    "stribeck",
    "floor_slope",
]


def with_effects(*names, **changes):
    effects = [{"name": name, **LISTED[name]} for name in names]
    return wpi_srs().with_values(effects=effects, **changes)


def test_the_package_knows_the_list():
    known = all_effects()
    assert set(known) >= set(LISTED)  # the others are held against the virtual laboratory
    for name, values in LISTED.items():
        assert [p.name for p in known[name].parameters] == list(values)
        assert known[name].size.name == next(iter(values))


def model_forces(robot, s, model="complex"):
    parameters, mechanics, _ = build(Structure.of(robot, model))
    pose, u = ca.SX.sym("pose", 3), ca.SX.sym("u", 3)
    forces = mechanics.forces(pose, u[0], u[1], u[2])
    f = ca.Function(
        "f",
        [mechanics.kappa, mechanics.dkappa, pose, u, parameters.vector],
        [forces.x, forces.y, forces.power],
    )
    place, speed, _ = oracle.body_state(robot, s)
    x, y, power = (
        np.asarray(v).ravel() for v in f(s.kappa, s.dkappa, place, speed, parameters.pack(robot, 50, 2))
    )
    return (x + 1j * y) * np.exp(1j * place[2]), power[0]


@pytest.mark.parametrize("law", ["per_axis", "cone"])
@pytest.mark.parametrize("names", [*[(n,) for n in MECHANICAL], tuple(MECHANICAL)], ids="+".join)
def test_forces_are_those_of_the_definition(names, law):
    robot = with_effects(*names, friction_law=law, friction_speed_m_s=0.05)
    for seed in range(4):
        s = oracle.random_state(np.random.default_rng(seed), 5)
        expected = oracle.external_forces(robot, s)
        found, power = model_forces(robot, s)
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-11 * abs(expected).max())
        _, v, _, _ = oracle.motion(oracle.Body.of(robot), s)
        assert power == pytest.approx((v.conj() * expected).real.sum(), rel=1e-9)


def actuator_rates(robot, kappa, dkappa, memory, valve, kpa, hertz):
    """kappa'' and z' as the list of effects defines them."""
    get = lambda name, key: oracle.size(robot, name, key)  # noqa: E731
    c0 = robot.curvature_per_pressure_1_m_kpa * kpa
    c0 = c0 / (1 + get("bending_resistance", "ratio")) * (1 - get("supply_droop", "per_hz") * hertz)
    target = c0 * valve + get("curvature_bias", "bias")
    segment = oracle.effect(robot, "segment_bias")
    if segment:
        target[segment["segment"] - 1] += segment["bias"]
    factor = np.where(valve * kappa < 0, 1 + get("fill_exhaust_asymmetry", "ratio"), 1.0)
    t1, t2 = robot.tau1_s * factor, robot.tau2_s * factor
    restoring = kappa + get("curvature_stiffening", "per_curv2") * kappa**3
    restoring = restoring + get("hysteresis", "ratio") * memory
    width = oracle.effect(robot, "hysteresis").get("width", 1.0)
    ddkappa = -(1 / t1 + 1 / t2) * dkappa - restoring / (t1 * t2) + target / (t1 * t2)
    return ddkappa, dkappa - abs(dkappa) * memory / width


@pytest.mark.parametrize("names", [(), *[(n,) for n in ACTUATION], tuple(ACTUATION)], ids="+".join)
def test_actuators_are_those_of_the_definition(names):
    robot = with_effects(*names)
    parameters, _, actuator = build(Structure.of(robot))
    x, valve = ca.SX.sym("x", actuator.states), ca.SX.sym("valve", 4)
    f = ca.Function("f", [x, valve, parameters.vector], [actuator.rates(actuator.unstack(x), valve).vector()])
    rng = np.random.default_rng(0)
    for valves in (np.array([1.0, -1, 1, -1]), np.array([-1.0, -1, 1, 1]), np.zeros(4)):
        kappa, dkappa = rng.normal(size=4) * 10, rng.normal(size=4) * 100
        memory = rng.normal(size=4) if actuator.memories else np.zeros(4)
        state = np.concatenate([kappa, dkappa] + [memory] * actuator.memories)
        found = np.asarray(f(state, valves, parameters.pack(robot, 50, 1.5))).ravel()
        ddkappa, memory_rate = actuator_rates(robot, kappa, dkappa, memory, valves, 50, 1.5)
        np.testing.assert_allclose(found[:4], dkappa)
        np.testing.assert_allclose(found[4:8], ddkappa, rtol=1e-11)
        if actuator.memories:
            np.testing.assert_allclose(found[8:], memory_rate, rtol=1e-11)


def test_fill_exhaust_asymmetry_against_an_integration_with_events():
    """The sign of the bend is smoothed in the model: the curvature stays within 0.1 % of the sharp one's."""
    from scipy.integrate import solve_ivp

    robot = with_effects("fill_exhaust_asymmetry")
    gait = published_wave(robot).gait()
    run = Integrator(robot)
    path = run.integrate(Timeline.of_gait(gait, 1.0), run.rest())
    state, start, worst = np.zeros(8), 0.0, 0.0
    durations, valves = gait.phases()
    for h, valve in zip(np.tile(durations, 2), np.tile(valves, 2).T):

        def rate(_t, y, valve=valve):
            return np.concatenate([y[4:], actuator_rates(robot, y[:4], y[4:], 0 * valve, valve, 55, 2)[0]])

        state = solve_ivp(rate, (0, h), state, rtol=1e-8, atol=1e-8, max_step=1e-3).y[:, -1]
        start += h
        node = np.argmin(abs(path.time_s - start))
        worst = max(worst, abs(path.kappa[node] - state[:4]).max())
    assert worst < 0.001 * 19.25


def test_closed_form_in_stages_equals_the_ode_with_nonlinear_effects():
    """One RK4 step of the nonlinear actuators has local order 5."""
    robot = with_effects("curvature_stiffening", "hysteresis")
    parameters, _, actuator = build(Structure.of(robot))
    x, valve, h = ca.SX.sym("x", actuator.states), ca.SX.sym("valve", 4), ca.SX.sym("h")
    f = ca.Function(
        "f", [x, valve, h, parameters.vector], [actuator.advance(actuator.unstack(x), valve, h).vector()]
    )
    p = parameters.pack(robot, 50, 2)
    start = np.concatenate([[5.0, -4, 3, 8], [50.0, 60, 70, 80], np.full(4, 0.5)])

    def after(steps):
        state = start
        for _ in range(steps):
            state = np.asarray(f(state, np.ones(4), 0.02 / steps, p)).ravel()
        return state

    exact = after(256)
    errors = [abs(after(k) - exact).max() for k in (2, 4, 8)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 3.6).all()


def test_all_effects_act_at_once_and_the_robot_still_moves():
    robot = with_effects(*LISTED)
    run = Integrator(robot)
    path = run.integrate(Timeline.of_gait(published_wave(robot).gait(), 1.0), run.rest())
    assert np.isfinite(path.pose).all()
    assert np.hypot(*path.pose[-1, :2]) > 0.01


@pytest.mark.parametrize("name", sorted(LISTED))
def test_zero_size_is_none(name):
    """Also through the equations themselves, where the effect is built in at size zero."""
    plain = wpi_srs()
    size = next(iter(LISTED[name]))
    robot = plain.with_values(effects=[{"name": name, **LISTED[name], size: 0.0}])
    assert Structure.of(robot) == Structure.of(plain)
    assert valve_delay_s(robot) == 0.0
    assert room_effects(robot) == []
    gait = published_wave(plain, offset=0.3).gait()
    assert steady_gait(robot, gait).speed_m_s == steady_gait(plain, gait).speed_m_s
    effect = all_effects()[name]
    if not effect.in_equations:
        return
    built_in = Structure("complex", 5, "per_axis", (name,))
    s = oracle.random_state(np.random.default_rng(1), 5)
    place, u, spin = oracle.body_state(plain, s)
    valve = np.array([1.0, -1, -1, 1])
    answers = []
    for structure, description in ((built_in, robot), (Structure.of(plain), plain)):
        parameters, mechanics, actuator = build(structure)
        pose, velocity, v = ca.SX.sym("pose", 3), ca.SX.sym("velocity", 3), ca.SX.sym("valve", 4)
        memory = tuple(ca.SX.ones(4, 1) for _ in range(actuator.memories))
        rates = actuator.rates(ActuatorState(mechanics.kappa, mechanics.dkappa, memory), v)
        f = ca.Function(
            "f",
            [mechanics.kappa, mechanics.dkappa, pose, velocity, v, parameters.vector],
            [ca.vertcat(mechanics.velocity_rate(pose, velocity)[0], rates.dkappa)],
        )
        p = parameters.pack(description, 50, 2)
        answers.append(np.asarray(f(s.kappa, s.dkappa, place, [u[0], u[1], spin], valve, p)).ravel())
    np.testing.assert_allclose(answers[0], answers[1], rtol=1e-12)


def test_dead_time_holds_the_valves_at_zero_and_then_shifts_them():
    timeline = Timeline.of_gait(published_wave(wpi_srs()).gait(), 1.0)
    robot = with_effects("dead_time", valve_delay_s=0.02)
    assert valve_delay_s(robot) == pytest.approx(0.05)
    late = timeline.delayed(0.05)
    assert late.end_s == pytest.approx(timeline.end_s)

    def at(t, schedule):
        ends = np.cumsum(schedule.duration_s)
        return schedule.valve[:, np.searchsorted(ends, t, side="right")]

    for t in np.linspace(0.001, 0.999, 77):
        expected = np.zeros(4) if t < 0.05 else at(t - 0.05, timeline)
        np.testing.assert_array_equal(at(t, late), expected)
    run, plain = Integrator(robot), Integrator(wpi_srs())
    delayed = run.integrate(timeline, run.rest())
    prompt = plain.integrate(timeline.until(0.95), plain.rest())
    np.testing.assert_allclose(delayed.final[:6], prompt.final[:6], atol=2e-4)
    np.testing.assert_allclose(delayed.kappa[-1], prompt.kappa[-1], rtol=1e-9)


def test_bias_acts_from_time_zero_and_is_not_divided_by_the_bending_resistance():
    robot = with_effects("curvature_bias", "bending_resistance")
    run = Integrator(robot)
    path = run.integrate(Timeline.vent(4, 3.0, 55.0), run.rest())
    np.testing.assert_allclose(path.kappa[-1], 1.2, rtol=1e-9)


def test_camera_sees_offset_scale_tilt_in_that_order():
    """marker = r + R(theta) (dx, dy), then (1 + scale) about the origin, then (1 + per_m x)."""
    r, theta = np.array([0.4, -0.7]), 0.8
    turned = np.array(
        [np.cos(theta) * 0.004 - np.sin(theta) * 0.003, np.sin(theta) * 0.004 + np.cos(theta) * 0.003]
    )
    expected = (r + turned) * 1.03
    expected = expected * (1 + 0.05 * expected[0])
    given = {
        "marker_offset": {"dx_m": 0.004, "dy_m": 0.003},
        "camera_scale": {"scale": 0.03},
        "camera_tilt": {"per_m": 0.05},
    }
    x, y = r
    for name, effect in all_effects().items():
        if effect.marker:
            x, y = effect.marker(given[name], x, y, theta)
        if effect.camera:
            x, y = effect.camera(given[name], x, y)
    assert [float(x), float(y)] == pytest.approx(expected, rel=1e-12)
    assert all_effects()["clock_offset"].clock({"offset_s": 0.03}) == 0.03


def refused(entry, links=5):
    document = Document("robot.yaml", {"links": links, "effects": [entry]}, {("effects", 0): 7})
    with pytest.raises(InputError) as caught:
        robot_from_document(document)
    text = str(caught.value)
    assert text.startswith("robot.yaml:7: effects[0]")
    assert "\n" not in text
    return text


@pytest.mark.parametrize("name", NOT_BELOW_ZERO)
def test_sizes_below_zero_are_refused(name):
    key = next(iter(LISTED[name]))
    assert "at least 0" in refused({"name": name, **LISTED[name], key: -0.01})


@pytest.mark.parametrize("name", sorted(set(LISTED) - set(NOT_BELOW_ZERO)))
def test_sizes_that_may_be_negative_are_taken(name):
    key = next(iter(LISTED[name]))
    robot = wpi_srs().with_values(effects=[{"name": name, **LISTED[name], key: -0.001}])
    assert robot.effects[0][key] == -0.001


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({"name": "fill_exhaust_asymmetry", "ratio": -1}, "greater than -1"),
        ({"name": "hysteresis", "ratio": 0.3, "width": 0}, "greater than 0"),
        ({"name": "stribeck", "excess": 1, "speed": 0.0}, "greater than 0"),
        ({"name": "tether_drgg", "force_n": 1}, "did you mean 'tether_drag'"),
        ({"name": "tether_drag", "force": 1}, "did you mean 'force_n'"),
        ({"name": "tether_drag"}, "needs 'force_n'"),
        ({"name": "segment_bias", "bias": 1, "segment": 5}, "from 1 (tail) to 4"),
        ({"name": "single_wheel_toe", "angle": 0.1, "link": 0}, "from 1 (tail) to 5"),
        ({"name": "single_wheel_toe", "angle": 0.1, "link": 1.5}, "found 1.5"),
        ({"name": "tether_drag", "force_n": "much"}, "expected a number in N"),
        ({"name": "tether_drag", "force_n": True}, "expected a number"),
        ({"name": "tether_drag", "force_n": 1e300}, "must lie between"),
        ({"name": "tether_drag", "force_n": 10**400}, "must be a finite number"),
        ({"name": "head_mass", "extra_kg": -0.03}, "above 0"),
        ({"name": "gap_length", "extra_m": -0.013}, "at least 0"),
    ],
)
def test_impossible_entries_are_refused_in_place(entry, words):
    assert words in refused(entry)


def test_the_same_effect_twice_is_refused_but_two_places_are_fine():
    bias = {"name": "segment_bias", "bias": 1.0}
    two = wpi_srs().with_values(effects=[{**bias, "segment": 3}, {**bias, "segment": 1, "bias": 2.0}])
    parameters, _, actuator = build(Structure.of(two))
    target = ca.Function("t", [parameters.vector], [actuator.target(ca.SX.zeros(4, 1))])
    np.testing.assert_allclose(np.asarray(target(parameters.pack(two, 50, 1))).ravel(), [2, 0, 1, 0])
    with pytest.raises(InputError, match="listed twice"):
        wpi_srs().with_values(effects=[{**bias, "segment": 3}, {**bias, "segment": 3}])

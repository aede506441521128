"""Steady gaits against long simulations, symmetries, finite differences and random robots."""

import math

import numpy as np
import pytest
from scipy.integrate import trapezoid

from srs_opt.errors import InputError
from srs_opt.gait import Gait, Wave, published_wave
from srs_opt.geometry import centre_of_rotation
from srs_opt.orbit.actuators import periodic_actuators
from srs_opt.orbit.body import integrator
from srs_opt.orbit.steady import steady_gait
from srs_opt.robot import wpi_srs
from srs_opt.simulate.cycle_motion import largest
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.rosenbrock import BODY_STATES, VELOCITY
from srs_opt.simulate.timeline import Timeline

FREE = Wave(1.7, 48.0, (0.0, 1.1, 1.9, 3.1), (0.3, -0.1, 0.2, 0.4)).gait()
TWO_PULSES = Gait(
    0.8,
    50.0,
    (((0.0, 0.3), (0.4, 0.6)), ((0.7, 0.2),), ((0.55, 0.05), (0.2, 0.3)), ((0.35, 0.7),)),
)


@pytest.mark.parametrize("model", ["complex", "simplified"])
@pytest.mark.parametrize("offset", [0.0, 0.5])
def test_agrees_with_thirty_simulated_periods(model, offset):
    robot, gait = wpi_srs(), Wave.uniform(4, 2, 50, 1.1, offset).gait()
    orbit = steady_gait(robot, gait, model)
    run = Integrator(robot, model)
    path = run.integrate(Timeline.of_gait(gait, 30 * gait.period_s), run.rest())
    at = [np.argmin(abs(path.time_s - k * gait.period_s)) for k in range(10, 31)]
    pose = path.pose[at]
    turn = np.diff(pose[:, 2])
    assert turn.mean() / gait.period_s == pytest.approx(orbit.turn_rate_rad_s, rel=1e-3, abs=2e-4)
    chord = np.hypot(*np.diff(pose[:, :2], axis=0).T).mean()
    assert chord == pytest.approx(np.hypot(*orbit.motion.displacement[:2]), rel=1e-3)
    assert np.diff(path.work_j[at]).mean() == pytest.approx(orbit.work_j, rel=1e-3)
    np.testing.assert_allclose(path.velocity[at[-1]], orbit.velocity, rtol=2e-3, atol=2e-4)


def test_friction_work_is_what_the_actuators_put_in():
    """Over a cycle the kinetic energy repeats: friction work = integral of T l kappa'."""
    import casadi as ca

    from srs_opt.model.inverse import inverse_dynamics
    from srs_opt.model.parameters import Structure
    from srs_opt.model.registry import build

    robot, gait = wpi_srs(), FREE
    orbit = steady_gait(robot, gait, tolerance=1e-6)
    structure = Structure.of(robot)
    parameters, mechanics, actuator = build(structure)
    x, valve = ca.SX.sym("x", actuator.states), ca.SX.sym("valve", 4)
    rates = ca.Function(
        "r", [x, valve, parameters.vector], [actuator.rates(actuator.unstack(x), valve).dkappa]
    )
    momentum = ca.SX.sym("m")
    spin = ca.Function(
        "w", [mechanics.kappa, mechanics.dkappa, momentum, parameters.vector], [mechanics.yaw_rate(momentum)]
    )
    inverse = inverse_dynamics(structure)
    p = parameters.pack(robot, gait.pressure_kpa, gait.frequency_hz)
    s = orbit.solution
    nodes = np.concatenate([s.start[:, None], s.states], axis=1)
    valves = s.valve[:, s.mesh.phase]

    def power(state, valve):
        kappa, dkappa = state[BODY_STATES : BODY_STATES + 4], state[BODY_STATES + 4 :]
        u = [state[3], state[4], float(spin(kappa, dkappa, state[5], p))]
        torque, _ = inverse(kappa, dkappa, rates(state[BODY_STATES:], valve, p), state[:3], u, p)
        return robot.segment_length_m * dkappa @ np.asarray(torque).ravel()

    work = sum(
        h / 2 * (power(nodes[:, i], valves[:, i]) + power(nodes[:, i + 1], valves[:, i]))
        for i, h in enumerate(s.mesh.h_s)
    )
    assert work == pytest.approx(orbit.work_j, rel=5e-3)


def test_curvature_repeats_and_has_the_closed_form():
    robot = wpi_srs()
    run = integrator(robot)
    p = run.pack(FREE.pressure_kpa, FREE.frequency_hz)
    act = periodic_actuators(run, FREE, p)
    orbit = steady_gait(robot, FREE)
    np.testing.assert_allclose(orbit.solution.states[BODY_STATES:, -1], act, rtol=1e-9)
    path = run.integrate(Timeline.of_gait(FREE, 8 / 1.7), run.rest())
    np.testing.assert_allclose(path.kappa[-1], act[:4], rtol=1e-9)


@pytest.mark.parametrize("gait", [FREE, TWO_PULSES], ids=["wave", "two pulses"])
@pytest.mark.parametrize("model", ["complex", "simplified"])
def test_mirrored_gait_mirrors_the_motion(gait, model):
    one, other = (steady_gait(wpi_srs(), g, model, tolerance=1e-6) for g in (gait, gait.mirrored()))
    assert other.turn_rate_rad_s == pytest.approx(-one.turn_rate_rad_s, rel=1e-4)
    assert other.speed_m_s == pytest.approx(one.speed_m_s, rel=1e-4)
    assert other.radius_m == pytest.approx(-one.radius_m, rel=1e-4)
    assert other.envelope_m == pytest.approx(one.envelope_m[::-1], abs=1e-4)
    assert other.work_j == pytest.approx(one.work_j, rel=1e-4)


def test_offset_alone_mirrors_the_steady_gait():
    left, right = (
        steady_gait(wpi_srs(), published_wave(wpi_srs(), offset=phi).gait()) for phi in (0.4, -0.4)
    )
    assert right.turn_rate_rad_s == pytest.approx(-left.turn_rate_rad_s, rel=1e-3)
    assert right.speed_m_s == pytest.approx(left.speed_m_s, rel=1e-3)
    assert left.turn_rate_rad_s > 0
    assert left.radius_m > 0


def test_mirrored_wave_mirrors_the_simulated_trajectory():
    """phi -> -phi together with beta -> beta + pi."""
    robot = wpi_srs()
    run = Integrator(robot)
    wave = Wave(2.0, 55, (0.2, 1.5, 2.5, 4.0), (0.3, 0.1, 0.2, 0.4))
    mirror = Wave(2.0, 55, tuple(b + math.pi for b in wave.phase_rad), tuple(-o for o in wave.offset))
    paths = [run.integrate(Timeline.of_gait(w.gait(), 2.0), run.rest(), 3e-7) for w in (wave, mirror)]
    np.testing.assert_allclose(paths[1].final[:3], paths[0].final[:3] * [1, -1, -1], atol=1e-5)
    np.testing.assert_allclose(paths[1].kappa[-1], -paths[0].kappa[-1], rtol=1e-9)


def test_trajectory_moves_and_turns_with_its_start():
    robot = wpi_srs()
    run = Integrator(robot)
    timeline = Timeline.of_gait(FREE, 2.0)
    here = run.integrate(timeline, run.rest())
    there = run.integrate(timeline, run.rest(2.0, -3.0, 1.2))
    turn = np.array([[np.cos(1.2), -np.sin(1.2)], [np.sin(1.2), np.cos(1.2)]])
    np.testing.assert_allclose(there.pose[:, :2], here.pose[:, :2] @ turn.T + [2, -3], atol=1e-9)
    np.testing.assert_allclose(there.pose[:, 2], here.pose[:, 2] + 1.2, atol=1e-9)


def test_reversed_wave_backs_up():
    ahead = steady_gait(wpi_srs(), Wave.uniform(4, 2, 45, 1.0).gait())
    back = steady_gait(wpi_srs(), Wave.uniform(4, 2, 45, 1.0).gait().reversed_wave())
    assert back.speed_m_s == pytest.approx(-ahead.speed_m_s, rel=1e-3)
    assert back.radius_m is None
    turning = steady_gait(wpi_srs(), FREE.reversed_wave())
    assert turning.speed_m_s < 0
    assert turning.speed_m_s == pytest.approx(turning.turn_rate_rad_s * turning.radius_m)


def test_shifting_a_gait_in_time_changes_only_the_clock():
    wave = Wave(1.7, 48.0, (0.0, 1.1, 1.9, 3.1), (0.3, -0.1, 0.2, 0.4))
    later = Wave(1.7, 48.0, tuple(b + 1.234 for b in wave.phase_rad), wave.offset)
    one, other = (steady_gait(wpi_srs(), w.gait(), tolerance=3e-6) for w in (wave, later))
    assert other.speed_m_s == pytest.approx(one.speed_m_s, rel=1e-4)
    assert other.radius_m == pytest.approx(one.radius_m, rel=1e-4)
    assert other.envelope_m == pytest.approx(one.envelope_m, abs=3e-4)


def test_multipliers_are_those_of_finite_differences():
    robot = wpi_srs().with_values(friction_speed_m_s=0.05)  # smooth, so that differences say something
    orbit = steady_gait(robot, FREE, tolerance=1e-6)
    run, s = integrator(robot), orbit.solution
    p = run.pack(FREE.pressure_kpa, FREE.frequency_hz)
    columns = []
    for i in range(3):
        step = np.zeros(3)
        step[i] = 1e-6 if i < 2 else 1e-9
        ends = []
        for sign in (1, -1):
            start = s.start.copy()
            start[VELOCITY] += sign * step
            ends.append(run.steps(start, s.mesh, s.valve, p)[0][VELOCITY, -1])
        columns.append((ends[0] - ends[1]) / (2 * step[i]))
    expected = np.sort(abs(np.linalg.eigvals(np.array(columns).T)))[::-1]
    np.testing.assert_allclose(abs(orbit.multipliers), expected, rtol=1e-4, atol=1e-7)
    assert orbit.shape_multiplier == pytest.approx(math.exp(-1 / 1.7 / 0.08))
    assert orbit.largest_multiplier < 1


def test_the_actuators_multiplier_knows_their_effects():
    """Against differences of the simulation, whose steps do not come from the orbit's own map."""
    robot = wpi_srs().with_values(effects=[{"name": "fill_exhaust_asymmetry", "ratio": 1.5}])
    gait = published_wave(robot).gait()
    orbit = steady_gait(robot, gait, tolerance=1e-6)
    run, s = integrator(robot), orbit.solution
    p, act = run.pack(gait.pressure_kpa, gait.frequency_hz), run.layout.actuator
    columns = []
    for i in range(act.start, act.stop):
        ends = []
        for sign in (1, -1):
            start = s.start.copy()
            start[i] += sign * 1e-4
            ends.append(run.steps(start, s.mesh, s.valve, p)[0][act, -1])
        columns.append((ends[0] - ends[1]) / 2e-4)
    expected = abs(np.linalg.eigvals(np.array(columns).T)).max()
    assert orbit.shape_multiplier == pytest.approx(expected, rel=0.02)
    assert orbit.shape_multiplier > 2 * steady_gait(wpi_srs(), gait).shape_multiplier


def test_perturbed_motion_returns_at_the_rate_of_the_largest_multiplier():
    robot = wpi_srs().with_values(friction_speed_m_s=0.05)
    orbit = steady_gait(robot, FREE, tolerance=1e-6)
    run, s = integrator(robot), orbit.solution
    p = run.pack(FREE.pressure_kpa, FREE.frequency_hz)
    start = s.start.copy()
    start[3] += 0.01
    gaps = []
    for _ in range(3):
        end = run.steps(start, s.mesh, s.valve, p)[0][:, -1]
        start = s.start.copy()
        start[VELOCITY] = end[VELOCITY]
        gaps.append(abs(end[3] - s.start[3]))
    assert gaps[2] / gaps[1] == pytest.approx(abs(orbit.multipliers[0]), rel=0.05)


@pytest.mark.parametrize("gait", [FREE, TWO_PULSES, published_wave(wpi_srs()).gait()])
def test_envelope_is_the_reach_about_the_mean_path(gait):
    """Against dense sampling of a simulation in steady state, with the chain built by the oracle."""
    import oracle_snake as oracle

    robot = wpi_srs()
    orbit = steady_gait(robot, gait, tolerance=1e-6)
    body = oracle.Body.of(robot)
    centre = centre_of_rotation(orbit.motion.displacement)
    heading = trapezoid(orbit.pose[:, 2], orbit.time_s) / gait.period_s
    reach = []
    for pose, kappa in zip(orbit.pose, orbit.kappa):
        pieces = [0j]
        angle = 0.0
        headings = [0.0]
        for k in kappa:
            for length, bend in [(body.gap / 2, 0.0)] + [(body.l / 20, k)] * 20 + [(body.gap / 2, 0.0)]:
                middle = angle + length * bend / 2
                pieces.append(pieces[-1] + length * np.sinc(length * bend / 2 / np.pi) * np.exp(1j * middle))
                angle += length * bend
            headings.append(angle)
        line = np.array(pieces)
        links = line[::22]
        turn = np.exp(1j * (pose[2] - np.mean(headings)))
        room = complex(pose[0], pose[1]) + (line - links.mean()) * turn
        reach.append(room)
    room = np.array(reach)
    if orbit.radius_m is not None:
        distance = abs(room - complex(*centre))
        outer = distance.max() - abs(orbit.radius_m) + 0.02
        inner = abs(orbit.radius_m) - distance.min() + 0.02
        expected = (outer, inner) if orbit.radius_m > 0 else (inner, outer)
        if orbit.speed_m_s < 0:
            assert orbit.radius_m * orbit.turn_rate_rad_s < 0
    else:
        direction = complex(*orbit.motion.displacement[:2])
        direction /= abs(direction) * np.sign((direction * np.exp(-1j * heading)).real)
        lateral = (room * np.conj(direction)).imag
        x = orbit.pose[:, 0] + 1j * orbit.pose[:, 1]
        mean = trapezoid((x * np.conj(direction)).imag, orbit.time_s) / gait.period_s
        expected = (mean - lateral.min() + 0.02, lateral.max() - mean + 0.02)
    assert orbit.envelope_m == pytest.approx(expected, abs=5e-4)


def test_gaits_without_steady_state_are_refused():
    with pytest.raises(InputError, match="never switches"):
        Wave.uniform(4, 2, 50, 1.0, 1.0)
    with pytest.raises(InputError, match="never switches"):
        Gait(1.0, 50.0, ((), ((0.0, 0.5),), ((0.0, 0.5),), ((0.0, 0.5),)))
    with pytest.raises(InputError, match=r"drives 3 segments, robot 'WPI SRS' has 4"):
        steady_gait(wpi_srs(), Wave.uniform(3, 2, 50, 1.0).gait())


def test_no_pressure_no_motion():
    orbit = steady_gait(wpi_srs(), Wave.uniform(4, 2, 0.0, 1.0).gait())
    assert orbit.speed_m_s == 0.0
    assert orbit.radius_m is None


def test_extreme_offset_still_has_a_steady_gait():
    orbit = steady_gait(wpi_srs(), published_wave(wpi_srs(), offset=0.999).gait())
    assert np.isfinite(orbit.speed_m_s)


def test_guess_leads_to_the_same_orbit_and_a_misleading_one_does_no_harm():
    plain = steady_gait(wpi_srs(), FREE)
    for guess in (plain.velocity, np.array([5.0, -5.0, 0.01])):
        again = steady_gait(wpi_srs(), FREE, guess=guess)
        assert again.speed_m_s == pytest.approx(plain.speed_m_s, rel=3e-4)


def test_room_effects_are_left_out_and_measurement_effects_change_nothing():
    plain = steady_gait(wpi_srs(), FREE).speed_m_s
    slope = {"name": "floor_slope", "angle": 0.05}
    camera = {"name": "camera_scale", "scale": 0.1}
    assert steady_gait(wpi_srs().with_values(effects=[slope, camera]), FREE).speed_m_s == plain


def random_case(rng, links):
    def between(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    along = between(0.005, 0.5)
    robot = wpi_srs().with_values(
        links=links,
        segment_length_m=between(0.015, 0.12),
        gap_length_m=float(rng.choice([0, between(0.002, 0.05)])),
        link_mass_kg=between(0.005, 0.5),
        link_inertia_kg_m2=float(rng.choice([0, between(1e-8, 1e-4)])),
        friction_tangential=along,
        friction_normal=max(along * 1.01, between(0.1, 1.2)),
        friction_speed_m_s=between(2e-4, 1e-2),
        tau1_s=between(0.02, 0.5),
        tau2_s=between(0.01, 0.3),
    )
    pressure = min(rng.uniform(0.1, 2.2) / robot.segment_length_m / 0.35, 250.0)
    frequency = between(0.2, 6.0)
    if rng.random() < 0.7:
        phases = np.cumsum(rng.normal(rng.choice([0.9, 1.5, -1.0]), 0.4, links - 1))
        offsets = rng.uniform(-0.8, 0.8, links - 1) * rng.choice([0, 1])
        return robot, Wave(frequency, pressure, tuple(map(float, phases)), tuple(map(float, offsets))).gait()
    intervals = []
    for _ in range(links - 1):
        edges = np.sort(rng.uniform(0, 0.999 / frequency, 2 * rng.integers(1, 4)))
        intervals.append(tuple((float(a), float(b)) for a, b in edges.reshape(-1, 2)))
    return robot, Gait(1 / frequency, pressure, tuple(intervals))


@pytest.mark.slow
@pytest.mark.parametrize("links", [3, 5, 12])
def test_random_robots_and_gaits_have_steady_states(links):
    rng = np.random.default_rng(links)
    for _ in range(25):
        robot, gait = random_case(rng, links)
        orbit = steady_gait(robot, gait)
        assert orbit.solution.residual_m_s < 1e-6
        assert orbit.work_j >= 0
        assert np.isfinite(orbit.motion.displacement).all()


@pytest.mark.slow
@pytest.mark.parametrize(("links", "seconds"), [(12, 300)])
def test_long_robots_compile_and_run_in_acceptable_time(links, seconds):
    """Compiling grows about linearly with the links; generous limits. Bends of about 1 rad."""
    import os

    robot = wpi_srs().with_values(links=links)
    started = sum(os.times()[:4])  # processor time, the compiler's too
    orbit = steady_gait(
        robot, Wave.uniform(links - 1, 1.0, 4 / 0.037 / links / 0.35, 2 * math.pi / (links - 1)).gait()
    )
    assert sum(os.times()[:4]) - started < seconds
    assert orbit.speed_m_s > 0


def test_the_largest_value_of_a_cycle_does_not_depend_on_where_it_begins():
    for begin in np.linspace(0, 0.1, 7):
        phase = 2 * math.pi * (np.linspace(0, 1, 97) + begin)
        curves = np.array([np.sin(phase), 0.5 + 0.7 * np.cos(phase) + 0.1 * np.sin(2 * phase)])
        fine = 2 * math.pi * np.linspace(0, 1, 20001)
        exact = (0.5 + 0.7 * np.cos(fine) + 0.1 * np.sin(2 * fine)).max()
        assert largest(curves) == pytest.approx(exact, abs=2e-5)
    assert largest(np.full((2, 9), 3.0)) == 3.0

"""Every hidden effect: nothing at zero size, visible at typical size, and right where a closed form tells."""

import dataclasses
import math

import numpy as np
import pytest

from srs_opt.effects import built_in
from virtual_lab import kernel
from virtual_lab.assemble import assemble
from virtual_lab.bench import tow_force
from virtual_lab.camera import centre_picture, picture
from virtual_lab.catalogue import KINDS, LISTED, UNLISTED
from virtual_lab.draw import draw_effect
from virtual_lab.errors import LabError
from virtual_lab.simulate import run, sample
from virtual_lab.trials import Schedule, Trial
from virtual_lab.truth import Parameters, Truth

G = 9.81
GAIT = Trial("t", 2.0, 55.0, 0.4, duration_s=3.0)
TOED = 0.03 * G * (0.043 * (math.cos(0.1) - 1) + 0.57 * math.sin(0.1))  # one wheel pair dragged askew
STILL = Trial("s", 1.0, 0.0, kind="still")
LABELS = np.arange(0, 3, 0.02)


def lab(*effects, parameters=None, **options):
    listed = tuple(e for e in effects if e["name"] in LISTED)
    other = tuple(e for e in effects if e["name"] in UNLISTED)
    return Truth(parameters or Parameters(), listed, other, **options)


def held(truth, segment=2, pressure=50.0, at=1.99, hold=9.0):
    """Curvatures long after one segment was bent to the left."""
    trial = Trial("s", 1e-9, pressure, schedule=Schedule(((segment, 0.0, hold),), 20.0))
    return run(truth, trial, np.atleast_1d(at)).kappa


def slide(truth, velocity, at=3.9, heading=0.0):
    """Samples of the straight, unpowered robot that was pushed at time 0."""
    tables = assemble(truth, STILL, 4.0)
    state = np.array([0, 0, heading, velocity[0], velocity[1], 0.0])
    return sample(tables, state, np.zeros((4, 4)), np.atleast_1d(np.asarray(at, float)))


def test_the_laboratory_knows_every_listed_effect_and_enough_others():
    assert set(LISTED) == set(built_in())  # nothing that the models know lacks a second formulation
    assert len(UNLISTED) >= 12
    assert not set(LISTED) & set(UNLISTED)


@pytest.mark.parametrize("name", sorted(KINDS))
def test_zero_size_is_no_effect(name):
    effect = draw_effect(KINDS[name], np.random.default_rng(1), 5, (0.0, 0.0))
    labels = LABELS[:50]
    assert np.max(np.abs(picture(lab(effect), GAIT, labels) - picture(Truth(), GAIT, labels))) < 1e-9


@pytest.mark.parametrize("name", sorted(KINDS))
def test_typical_size_is_seen_in_the_tracks(name):
    """The markers move by more than twice the camera's noise (rms over a trial of 4 s)."""
    rng = np.random.default_rng(2)
    labels = np.arange(0, 4, 0.05)
    seen = []
    for trial in (GAIT, Trial("u", 1.0, 41.0, -0.4, heading_rad=math.pi / 2)):
        effect = draw_effect(KINDS[name], rng, 5, (1.0, 1.0))
        if "direction" in effect:
            effect["direction"] = 0.3  # where the robot goes
        change = picture(lab(effect), trial, labels) - picture(Truth(), trial, labels)
        seen.append(np.sqrt(np.mean(change**2)))
    assert max(seen) > 0.002
    assert np.isfinite(seen).all()


def test_all_effects_at_once():
    rng = np.random.default_rng(3)
    effects = [draw_effect(kind, rng, 5, (0.3, 0.3)) for kind in KINDS.values()]
    assert np.isfinite(picture(lab(*effects), GAIT, LABELS)).all()


@pytest.mark.parametrize("links", [3, 12])
def test_other_numbers_of_links(links):
    rng = np.random.default_rng(links)
    effects = [draw_effect(kind, rng, links, (0.3, 0.3)) for kind in LISTED.values()]
    seen = picture(lab(*effects, parameters=Parameters(links=links)), GAIT, LABELS)
    assert seen.shape == (len(LABELS), links, 2)
    assert np.isfinite(seen).all()


# measurement


def test_dead_time_and_clock_offset_shift_the_track():
    plain = run(Truth(), GAIT, LABELS - 0.03)
    dead = run(lab({"name": "dead_time", "delay_s": 0.03}), GAIT, LABELS)
    np.testing.assert_allclose(dead.x, plain.x, atol=1e-5)
    late = picture(lab({"name": "clock_offset", "offset_s": -0.03}), GAIT, LABELS)
    np.testing.assert_allclose(late[..., 0], plain.x, atol=1e-12)
    early = picture(lab({"name": "clock_offset", "offset_s": 0.04}), GAIT, LABELS)
    np.testing.assert_allclose(early[..., 1], run(Truth(), GAIT, LABELS + 0.04).y, atol=1e-5)


def test_camera_effects_in_their_order():
    truth = lab(
        {"name": "marker_offset", "dx_m": 0.003, "dy_m": -0.002},
        {"name": "camera_scale", "scale": 0.02},
        {"name": "camera_tilt", "per_m": 0.05},
    )
    r = run(Truth(), GAIT, LABELS)
    x = 1.02 * (r.x + np.cos(r.theta) * 0.003 + np.sin(r.theta) * 0.002)
    y = 1.02 * (r.y + np.sin(r.theta) * 0.003 - np.cos(r.theta) * 0.002)
    expected = np.stack([x * (1 + 0.05 * x), y * (1 + 0.05 * x)], axis=2)
    np.testing.assert_allclose(picture(truth, GAIT, LABELS), expected, atol=1e-9)


def test_rolling_shutter_shows_each_marker_at_its_own_time():
    seen = picture(lab({"name": "rolling_shutter", "delay_s": 0.01}), GAIT, LABELS)
    for i in (0, 4):
        np.testing.assert_allclose(seen[:, i, 0], run(Truth(), GAIT, LABELS + 0.01 * i).x[:, i], atol=1e-5)


def test_centre_of_mass_is_weighted():
    truth = lab({"name": "head_mass", "extra_kg": 0.03})
    seen = centre_picture(truth, GAIT, np.zeros(1))
    np.testing.assert_allclose(seen[0, 0], [0.049 * (0 + 1 + 2 + 3 + 2 * 4) / 6, 0], atol=1e-12)


# bending


def test_resistance_droop_and_bias():
    resist = {"name": "bending_resistance", "ratio": 0.25}
    assert held(lab(resist))[0, 1] == pytest.approx(17.5 / 1.25, rel=1e-6)
    assert held(lab(resist, {"name": "curvature_bias", "bias": 2.0}))[0] == pytest.approx(
        [2, 16, 2, 2], rel=1e-6
    )
    one = held(lab({"name": "segment_bias", "bias": -3.0, "segment": 4}))
    assert one[0] == pytest.approx([0, 17.5, 0, -3], abs=1e-5)
    droop = assemble(lab({"name": "supply_droop", "per_hz": 0.1}), GAIT, 1.0)
    assert np.abs(droop.push).max() == pytest.approx(0.35 * 55 * 0.8)
    start = run(lab({"name": "curvature_bias", "bias": 2.0}), STILL, np.array([0.0, 0.05, 3.0])).kappa
    expected = 2 * (1 - (0.08 * math.exp(-0.05 / 0.08) - 0.05 * math.exp(-1)) / 0.03)
    np.testing.assert_allclose(start, [[0] * 4, [expected] * 4, [2] * 4], atol=1e-7)


def test_stiffening_and_hysteresis_at_rest():
    kappa = held(lab({"name": "curvature_stiffening", "per_curv2": 6e-4}))[0, 1]
    assert kappa + 6e-4 * kappa**3 == pytest.approx(17.5, rel=1e-6)
    kappa = held(lab({"name": "hysteresis", "ratio": 0.35, "width": 4.0}), at=4.0)[0, 1]
    assert kappa + 0.35 * 4 * (1 - math.exp(-kappa / 4)) == pytest.approx(17.5, rel=1e-6)


def test_exhaust_is_slower_until_the_bend_changes_side():
    truth = lab({"name": "fill_exhaust_asymmetry", "ratio": 0.5})
    fill = held(truth, at=np.array([0.1]))[0, 1]
    assert fill == pytest.approx(
        17.5 * (1 - (0.08 * math.exp(-0.1 / 0.08) - 0.05 * math.exp(-2)) / 0.03), rel=1e-6
    )
    exhaust = held(truth, at=np.array([3.1]), hold=3.0)[0, 1]
    decay = (0.12 * math.exp(-0.1 / 0.12) - 0.075 * math.exp(-0.1 / 0.075)) / 0.045
    assert exhaust > 0
    assert exhaust == pytest.approx(-17.5 + 35 * decay, rel=1e-6)


def test_geometry_effects():
    longer = run(lab({"name": "gap_length", "extra_m": 0.008}), STILL, np.zeros(1))
    np.testing.assert_allclose(np.diff(longer.x[0]), 0.057)
    truth = lab({"name": "gap_bending", "ratio": 0.6})
    trial = Trial("s", 1.0, 50.0, schedule=Schedule(((2, 0.0, 9.0),), 20.0))
    bent = run(truth, trial, np.array([4.0]))
    kappa = bent.kappa[0, 1]
    assert bent.theta[0, 2] - bent.theta[0, 1] == pytest.approx((0.037 + 0.6 * 0.012) * kappa)
    # walk along the middle line in a thousand small pieces
    curvature = np.repeat([0.6 * kappa, kappa, 0.6 * kappa], 20000)
    ds = np.repeat([0.006, 0.037, 0.006], 20000) / 20000
    heading = bent.theta[0, 1] + np.cumsum(curvature * ds) - 0.5 * curvature * ds
    step = np.array([np.sum(ds * np.cos(heading)), np.sum(ds * np.sin(heading))])
    found = [bent.x[0, 2] - bent.x[0, 1], bent.y[0, 2] - bent.y[0, 1]]
    np.testing.assert_allclose(found, step, atol=1e-9)


# wheels, tether, room


@pytest.mark.parametrize(
    ("effect", "extra"),
    [
        ({"name": "tether_drag", "force_n": 0.035}, 0.035),
        ({"name": "tether_viscous", "damping": 0.25}, 0.25 * 0.2),
        ({"name": "tether_pull", "force_n": 0.03, "ax_m": -2.0, "ay_m": 0.0}, 0.03),
        ({"name": "tether_weight", "load_n": 0.2}, 0.043 * 0.2),
        ({"name": "viscous_rolling", "damping": 0.06}, 5 * 0.06 * 0.2),
        ({"name": "stribeck", "excess": 1.0, "speed": 0.2}, 5 * 0.03 * G * 0.043 * math.exp(-1)),
        ({"name": "slip_rate", "per_speed": 8.0}, 0.0),
        ({"name": "floor_slope", "angle": 0.006, "direction": math.pi}, 5 * 0.03 * G * math.sin(0.006)),
        ({"name": "floor_slope", "angle": 0.006, "direction": 0.0}, -5 * 0.03 * G * math.sin(0.006)),
        ({"name": "head_mass", "extra_kg": 0.02}, 0.02 * G * 0.043),
        ({"name": "single_wheel_toe", "angle": 0.1, "link": 3}, TOED),
        ({"name": "quadratic_drag", "drag": 0.5}, 5 * 0.5 * 0.04),
        ({"name": "stiff_wheel", "excess": 5.0, "link": 2}, 5.0 * 0.03 * G * 0.043),
        ({"name": "hose_spring", "stiffness": 0.1, "ax_m": -0.2, "ay_m": 0.0, "slack_m": 0.3}, 0.0),
        ({"name": "hose_spring", "stiffness": 0.1, "ax_m": -0.5, "ay_m": 0.0, "slack_m": 0.3}, 0.02),
        ({"name": "reverse_friction", "excess": 1.5}, 0.0),
    ],
)  # fmt: skip
def test_towing_force(effect, extra):
    rolling = 5 * 0.03 * G * 0.043
    assert tow_force(lab(effect), 0.2) == pytest.approx(rolling + extra, rel=1e-4)
    without = rolling if KINDS[effect["name"]].part == "tether" else rolling + extra
    assert tow_force(lab(effect), 0.2, tether=False) == pytest.approx(without, rel=1e-4)


def test_friction_is_larger_backwards():
    assert tow_force(lab({"name": "reverse_friction", "excess": 1.5}), -0.2) == pytest.approx(
        -2.5 * 5 * 0.03 * G * 0.043
    )


def test_toed_wheels_roll_where_they_point():
    v = 0.5
    truth = lab({"name": "wheel_toe", "angle": 0.2}, friction_speed_m_s=1e-4)
    end = slide(truth, (v * math.cos(0.2), v * math.sin(0.2)))[0]
    length = v * v / (2 * 0.043 * G)
    assert end[0] == pytest.approx(length * math.cos(0.2), rel=2e-3)
    assert end[1] == pytest.approx(length * math.sin(0.2), rel=2e-3)
    assert end[2] == pytest.approx(0, abs=1e-9)


def test_sideways_slide_with_slip_rate():
    k, v, a = 8.0, 0.5, 0.57 * G
    end = slide(lab({"name": "slip_rate", "per_speed": k}, friction_speed_m_s=1e-4), (0, v), at=1.0)[0]
    assert end[1] == pytest.approx((v - math.log(1 + k * v) / k) / (a * k), rel=2e-3)


def test_load_at_the_tail_is_no_mass():
    end = slide(lab({"name": "tether_weight", "load_n": 0.2}, friction_speed_m_s=1e-4), (0.4, 0))[0]
    assert end[0] == pytest.approx(0.16 / (2 * 0.043 * (G + 0.2 / 0.15)), rel=2e-3)


def test_pulls_accelerate_all_the_mass():
    ice = Parameters(friction_tangential=0.0, friction_normal=0.0)
    slope = {"name": "floor_slope", "angle": 0.01, "direction": 0.7}
    end = slide(lab(slope, parameters=ice), (0, 0), at=2.0)[0]
    fall = 0.5 * G * math.sin(0.01) * 4
    np.testing.assert_allclose(end[:3], [fall * math.cos(0.7), fall * math.sin(0.7), 0], atol=1e-9)
    pull = {"name": "tether_pull", "force_n": 0.03, "ax_m": -50.0, "ay_m": 0.0}
    assert slide(lab(pull, parameters=ice), (0, 0), at=2.0)[0, 0] == pytest.approx(-0.5 * 0.03 / 0.15 * 4)


def test_segments_leak_and_tank_empties():
    leak = held(lab({"name": "crosstalk", "ratio": 0.2}))[0]
    assert leak == pytest.approx([3.5, 17.5, 3.5, 0], abs=1e-5)
    weak = held(lab({"name": "leaking_segment", "loss": 0.2, "segment": 2}))[0]
    assert weak == pytest.approx([0, 0.8 * 17.5, 0, 0], abs=1e-5)
    emptying = assemble(lab({"name": "tank_empties", "per_s": 0.06}), GAIT, 1.0).bend
    assert kernel.supply(2.0, emptying) == pytest.approx(math.exp(-0.12))


def test_no_tether_no_tether_effects():
    hose = lab({"name": "tether_drag", "force_n": 0.035}, {"name": "hose_torsion", "torque_n_m": 1e-3})
    free = dataclasses.replace(GAIT, tether=False)
    assert np.max(np.abs(picture(hose, free, LABELS) - picture(Truth(), GAIT, LABELS))) < 1e-12


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        ({"name": "tether_drg", "force_n": 1.0}, "did you mean 'tether_drag'"),
        ({"name": "tether_drag"}, "needs 'force_n'"),
        ({"name": "tether_drag", "force_n": math.nan}, "finite"),
        ({"name": "tether_drag", "force_n": 1.0, "colour": 2.0}, "no parameter 'colour'"),
        ({"name": "segment_bias", "bias": 1.0, "segment": 5}, "not one of 1 to 4"),
    ],
)
def test_bad_effects_are_refused(effect, words):
    with pytest.raises(LabError, match=words):
        Truth(effects=(effect,))


def test_effects_stand_under_their_own_heading():
    with pytest.raises(LabError, match="belongs under 'unlisted'"):
        Truth(effects=({"name": "crosstalk", "ratio": 0.1},))

"""Rotations and poses against complex numbers; a segment's chord and sagitta against its arcs, summed up."""

import casadi as ca
import numpy as np
import pytest

from srs_opt.geometry import (
    compose,
    distance_along,
    points_in_room,
    quarter_turn,
    relative,
    rotate,
    rotate_back,
    rotation_matrix,
    turn_onto,
    turning_angles,
    unit_vectors,
    wrapped,
)
from srs_opt.model.kinematics import segment_sagitta

FRAME = np.array([0.3, -0.2, 2.5])


def test_rotations_are_products_of_complex_numbers():
    rng = np.random.default_rng(1)
    x, y, angle = rng.normal(size=(3, 20))
    turned = (x + 1j * y) * np.exp(1j * angle)
    assert np.allclose(rotate(angle, x, y), (turned.real, turned.imag))
    assert np.allclose(rotate_back(angle, *rotate(angle, x, y)), (x, y))
    assert np.allclose(rotation_matrix(0.7) @ [x[0], y[0]], rotate(0.7, x[0], y[0]))
    assert np.allclose(np.exp(1j * wrapped(9 * angle)), np.exp(9j * angle))
    assert np.abs(wrapped(9 * angle)).max() <= np.pi


def test_poses_compose_and_come_back():
    local = np.random.default_rng(2).normal(size=(4, 5, 3))
    room = compose(FRAME, local)
    place = FRAME[0] + 1j * FRAME[1] + (local[..., 0] + 1j * local[..., 1]) * np.exp(1j * FRAME[2])
    assert np.allclose(room[..., 0] + 1j * room[..., 1], place)
    assert np.allclose(relative(FRAME, room), local)
    assert np.allclose(points_in_room(local[..., :2], FRAME), room[..., :2])


def test_distance_along_a_square():
    assert np.allclose(distance_along(np.array([[0, 0], [1, 0], [1, 2], [0, 2]])), [0, 1, 3, 4])


@pytest.mark.parametrize("ratio", [0.0, 0.6])
@pytest.mark.parametrize("kappa", [-12.0, 1e-9, 19.0])
def test_the_middle_of_a_segment_lies_beside_its_chord(kappa, ratio):
    length, gap, n = 0.037, 0.012, 40_000
    step = (length + gap) / n
    along = (np.arange(n) + 0.5) * step
    in_chamber = (along > gap / 2) & (along < gap / 2 + length)
    turn = np.where(in_chamber, kappa, ratio * kappa) * step
    heading = np.cumsum(turn) - turn / 2
    line = np.concatenate([[0], np.cumsum(step * np.exp(1j * heading))])
    chord, middle = line[-1], line[n // 2]
    right = -(np.conj(chord) * (middle - chord / 2)).imag / abs(chord)
    assert float(ca.evalf(segment_sagitta(ca.SX(kappa), length, gap, ratio))) == pytest.approx(
        right, abs=1e-8
    )


def test_a_polyline_turns_by_the_angles_that_it_was_made_of():
    turns = np.array([0.3, -3.0, 3.1, 0.0])
    chords = np.linspace(1, 2, 5)[:, None] * unit_vectors(2.0 + np.concatenate([[0.0], np.cumsum(turns)]))
    line = np.concatenate([np.zeros((1, 2)), np.cumsum(chords, axis=0)])
    assert turning_angles(np.stack([line, line @ rotation_matrix(1.0).T])) == pytest.approx(
        np.stack([turns, turns])
    )


def test_a_quarter_turn_is_the_derivative_of_a_unit_vector():
    angle, step = np.linspace(-4, 4, 9), 1e-6
    change = (unit_vectors(angle + step) - unit_vectors(angle - step)) / (2 * step)
    assert quarter_turn(unit_vectors(angle)) == pytest.approx(change, abs=1e-9)


def test_the_best_rotation_of_points_onto_others_is_found():
    rng = np.random.default_rng(5)
    points, noise = rng.standard_normal((2, 3, 8, 2)) @ np.array([1, 1j])
    angles = np.array([0.4, -2.9, 3.0])
    onto = points * np.exp(1j * angles)[:, None]
    np.testing.assert_allclose(turn_onto(points, onto, axis=1), angles, atol=1e-12)
    # least squares by trying every angle
    tried, noisy = np.linspace(-np.pi, np.pi, 6001), onto[0] + 0.3 * noise[0]
    missed = [np.abs(noisy - np.exp(1j * a) * points[0]) ** 2 for a in tried]
    best = tried[np.argmin(np.sum(missed, axis=1))]
    assert float(turn_onto(points[0], noisy)) == pytest.approx(best, abs=1.1e-3)

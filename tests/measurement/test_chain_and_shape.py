"""The chain's geometry against two other derivations; shapes from noisy, partial, swapped markers."""

import casadi as ca
import numpy as np
import pytest
from measure_fixtures import ROBOT, binomial_allows, chain_points, gait_track

from srs_opt.errors import InputError
from srs_opt.measurement.chain import chain_of, headings, link_positions, position_jacobian
from srs_opt.measurement.labels import correct_labels
from srs_opt.measurement.shape import shape_from_markers
from srs_opt.measurement.smooth import Intensity, smooth_shape
from virtual_lab.simulate import run
from virtual_lab.trials import Trial as LabTrial
from virtual_lab.truth import Truth

CHAIN = chain_of(ROBOT)
SD = 1e-3
INTENSITY = Intensity(0.01, 6.0, 1.2e5)


def some_configurations(count=20, seed=0):
    rng = np.random.default_rng(seed)
    q = np.column_stack([rng.normal(size=(count, 3)), 10 * rng.normal(size=(count, 4))])
    q[0, 3:] = 0
    q[1, 3:] = 1e-4
    return q


def lab_run(frequency=1.5, offset=0.2, lag=np.pi / 2, seconds=4.0, heading=0.3, rate=120.0):
    trial = LabTrial("a", frequency, 48.0, offset, lag, heading, seconds)
    time = np.arange(round(seconds * rate)) / rate
    return time, run(Truth(), trial, time)


def noisy(lab, seed=0, lost=0.0, sd=SD):
    rng = np.random.default_rng(seed)
    points = np.stack([lab.x, lab.y], axis=-1)
    points = points + sd * rng.normal(size=points.shape)
    points[rng.random(points.shape[:2]) < lost] = np.nan
    return points


def test_geometry_against_tiny_steps():
    for q in some_configurations(5):
        points = link_positions(CHAIN, q)
        start = headings(CHAIN, q)[0]
        walked = chain_points(q[3:], x=points[0, 0], y=points[0, 1], tail_heading=start)
        assert np.allclose(points, walked, atol=1e-8)
        assert np.allclose(points.mean(axis=0), q[:2])
        assert np.isclose(headings(CHAIN, q).mean(), q[2])


def test_geometry_agrees_with_the_models():
    from srs_opt.model.kinematics import body_frame_chain

    kappa = ca.SX.sym("kappa", 4)
    chain = body_frame_chain(kappa, ca.DM.ones(5), ROBOT.segment_length_m, ROBOT.gap_length_m)
    shape = ca.Function("shape", [kappa], [ca.horzcat(chain.x, chain.y, chain.angle)])
    for q in some_configurations():
        q = np.r_[0, 0, 0, q[3:]]
        there = np.array(shape(q[3:]))
        assert np.allclose(link_positions(CHAIN, q), there[:, :2], atol=1e-12)
        assert np.allclose(headings(CHAIN, q), there[:, 2], atol=1e-12)


def test_jacobian():
    q = some_configurations()
    jacobian = position_jacobian(CHAIN, q)
    for k, step in enumerate(1e-6 * np.eye(7)):
        numeric = (link_positions(CHAIN, q + step) - link_positions(CHAIN, q - step)) / 2e-6
        assert np.allclose(jacobian[..., k], numeric, atol=1e-8)


def test_exact_markers_give_the_exact_shape():
    q = np.column_stack(
        [np.zeros((50, 2)), np.linspace(-3, 3, 50), *[np.full(50, k) for k in (8, -5, 9, 12)]]
    )
    found = shape_from_markers(ROBOT, link_positions(CHAIN, q), 1e-7)
    assert np.allclose(found.curvature_1_m, q[:, 3:], atol=1e-2)
    assert np.allclose(found.centre_m, q[:, :2], atol=1e-6)
    assert np.allclose(np.diff(found.heading_rad), np.diff(q[:, 2]), atol=1e-4)
    assert found.determined.all()


def test_straight_frames_are_said_to_be_undetermined():
    straight = link_positions(CHAIN, np.zeros((3, 7)))
    found = shape_from_markers(ROBOT, straight, SD)
    assert not found.determined.any()
    assert np.allclose(found.curvature_1_m, 0, atol=1e-6)


def test_frames_with_too_few_markers_are_finite_and_undetermined():
    points = link_positions(CHAIN, np.tile([0, 0, 0, 8, -5, 9, 12.0], (4, 1)))
    points[0, 1:4] = np.nan
    points[1, 1:] = np.nan
    points[2] = np.nan
    found = shape_from_markers(ROBOT, points, 1e-5)
    assert found.determined.tolist() == [False, False, False, True]
    assert np.isfinite(found.configuration).all()
    assert np.isfinite(found.covariance).all()


def test_nothing_seen_is_an_input_error():
    with pytest.raises(InputError, match="lost in every frame"):
        shape_from_markers(ROBOT, np.full((5, 5, 2), np.nan), SD)
    with pytest.raises(InputError, match="expected"):
        shape_from_markers(ROBOT, np.zeros((5, 4, 2)), SD)
    with pytest.raises(InputError, match="increasing"):
        smooth_shape(ROBOT, np.zeros(5), np.zeros((5, 5, 2)), SD)


def test_swapped_labels_are_mended():
    _, lab = lab_run(seconds=2.0)
    clean = noisy(lab, lost=0.02)
    swapped = clean.copy()
    swapped[60:75, [1, 3]] = swapped[60:75, [3, 1]]
    swapped[100:, [0, 4]] = swapped[100:, [4, 0]]
    found = correct_labels(CHAIN, swapped)
    assert np.allclose(found.markers_m, clean, equal_nan=True)
    assert found.swapped[60:75].all()
    assert found.swapped[100:].all()
    assert not found.swapped[:60].any()


def test_ghosts_are_dropped():
    _, lab = lab_run(seconds=2.0)
    clean = noisy(lab)
    clean[50:70, 2] = np.nan
    ghost = clean.copy()
    ghost[50:70, 2] = [0.5, 0.5]
    found = correct_labels(CHAIN, ghost)
    assert np.allclose(found.markers_m, clean, equal_nan=True)
    assert found.dropped[50:70, 2].all()
    assert found.dropped.sum() == 20


def test_sound_labels_are_left_alone():
    _, points = gait_track()
    found = correct_labels(CHAIN, points)
    assert not found.swapped.any()
    assert np.array_equal(found.markers_m, points)


def test_smoother_beats_single_frames_and_survives_half_the_markers():
    time, lab = lab_run()
    for lost in (0.0, 0.5):
        points = noisy(lab, lost=lost)
        frame = shape_from_markers(ROBOT, points, SD).curvature_1_m - lab.kappa
        smooth = smooth_shape(ROBOT, time, points, SD, INTENSITY)
        error = np.sqrt(((smooth.curvature_1_m - lab.kappa) ** 2).mean())
        assert error < 0.6 * np.sqrt((frame**2).mean())
        assert error < 3.5
        centre = np.linalg.norm(smooth.centre_m - lab.centre_of_mass(), axis=1)
        assert np.sqrt((centre**2).mean()) < 0.7e-3
        speed = np.linalg.norm(np.gradient(lab.centre_of_mass(), time, axis=0) - smooth.velocity_m_s, axis=1)
        assert np.sqrt((speed[5:-5] ** 2).mean()) < 0.03


def test_likelihood_finds_sensible_intensities():
    time, lab = lab_run(seconds=2.0)
    found = smooth_shape(ROBOT, time, noisy(lab), SD).intensity
    assert 1e4 < found.curvature < 1e6
    assert 0.3 < found.heading < 60


def test_a_gap_in_time_is_bridged_with_wider_bands():
    time, lab = lab_run(seconds=2.0)
    points = noisy(lab)
    keep = np.r_[0:100, 130:240]
    whole = smooth_shape(ROBOT, time, points, SD, INTENSITY)
    gap = smooth_shape(ROBOT, time[keep], points[keep], SD, INTENSITY)
    assert np.allclose(gap.curvature_1_m[:60], whole.curvature_1_m[:60], atol=1.0)
    assert (gap.curvature_sd_1_m[100] > 1.2 * whole.curvature_sd_1_m[130]).all()


def test_smoothed_marginals_are_those_of_the_full_inverse():
    from srs_opt.measurement import smooth

    time, lab = lab_run(seconds=0.1)
    problem = smooth._Problem(CHAIN, time, noisy(lab), SD)
    spread = INTENSITY.per_component(CHAIN)
    z, (diagonal, coupling) = smooth._most_probable(problem, spread, smooth._start(problem))
    frames, size = len(time), 14
    full = np.zeros((frames, size, frames, size))
    for k in range(frames):
        full[k, :, k, :] = diagonal[k]
    for k in range(frames - 1):
        full[k, :, k + 1, :], full[k + 1, :, k, :] = coupling[k], coupling[k].T
    inverse = np.linalg.inv(full.reshape(frames * size, -1)).reshape(full.shape)
    expected = np.stack([inverse[k, :, k, :] for k in range(frames)])
    found = smooth._marginals(diagonal.copy(), coupling)
    scale = np.sqrt(np.einsum("kii->ki", expected))
    assert np.allclose(
        found / scale[:, :, None] / scale[:, None], expected / scale[:, :, None] / scale[:, None], atol=1e-5
    )
    best = smooth._objective(problem, spread, z)
    rng = np.random.default_rng(0)
    assert all(
        best < smooth._objective(problem, spread, z + 1e-3 * rng.normal(size=z.shape)) for _ in range(10)
    )


def test_bands_cover_at_their_stated_rate():
    """90 % bands of centre, heading, curvature and curvature rate: one random frame per independent run."""
    rng = np.random.default_rng(5)
    hits = {"centre": 0, "heading": 0, "curvature": 0, "rate": 0, "frame": 0}
    runs = 40
    for number in range(runs):
        time, lab = lab_run(1.0 + rng.random(), rng.uniform(-0.5, 0.5), rng.uniform(0.8, 1.6), seconds=1.0)
        points = noisy(lab, seed=number, lost=0.1)
        smooth = smooth_shape(ROBOT, time, points, SD, INTENSITY)
        frame = shape_from_markers(ROBOT, points, SD)
        k, segment = int(rng.integers(20, 115)), int(rng.integers(4))
        z = {
            "centre": (smooth.centre_m[k, 0] - lab.centre_of_mass()[k, 0]) / smooth.sd[k, 0],
            "heading": (smooth.heading_rad[k] - lab.theta[k].mean()) / smooth.sd[k, 2],
            "curvature": (smooth.curvature_1_m - lab.kappa)[k, segment] / smooth.curvature_sd_1_m[k, segment],
            "rate": (smooth.curvature_rate_1_ms - lab.kappa_rate)[k, segment] / smooth.sd[k, 10 + segment],
            "frame": (frame.curvature_1_m - lab.kappa)[k, segment] / frame.curvature_sd_1_m[k, segment],
        }
        for name, value in z.items():
            hits[name] += abs(value) < 1.645
    for name, count in hits.items():
        assert binomial_allows(count, runs, 0.90), (name, count, runs)

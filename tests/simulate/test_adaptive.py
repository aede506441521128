"""The one loop that adapts a mesh to a motion, with a made-up integrator whose errors are known."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from srs_opt.simulate.adaptive import Adapted, NonFiniteMotionError, adapted
from srs_opt.simulate.batched import StepRequest, StepResult
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.settings import MeshSettings

TOLERANCE = 1e-5


def _play(first, respond, **options) -> tuple[Adapted, list[StepRequest]]:
    """Answer every request of the search with `respond`, a function of the steps' lengths and times."""
    search = adapted(first, TOLERANCE, **options)
    asked = [next(search)]
    try:
        while True:
            h_s = asked[-1].mesh.h_s
            end_s = np.cumsum(h_s)
            states, errors = respond(h_s, end_s)
            asked.append(search.send(StepResult(np.atleast_2d(states), errors)))
    except StopIteration as done:
        return done.value, asked


def _request(step_s: float = 0.1) -> StepRequest:
    durations = np.array([0.5, 0.5])
    return StepRequest(
        None, np.zeros(1), Mesh.uniform(durations, step_s), np.array([[1.0, -1.0]]), np.zeros(1)
    )


def _fourth_order(scale: float):
    """Return an integrator whose local error is `scale` h^4, ten thousand times that in 0.42 < t < 0.46."""

    def respond(h_s, end_s):
        sharp = np.where((end_s > 0.42) & (end_s - h_s < 0.46), 1e4, 1.0)
        return end_s, scale * sharp * h_s**4

    return respond


def test_the_mesh_serves_when_no_step_errs_by_more_than_is_accepted():
    got, asked = _play(_request(), _fourth_order(1.0))
    assert got.error_m_s.max() <= 8 * TOLERANCE
    assert len(asked) > 1
    assert np.bincount(got.mesh.phase, got.mesh.h_s) == pytest.approx([0.5, 0.5])
    # short steps only where the motion is sharp
    end_s = np.cumsum(got.mesh.h_s)
    sharp = (end_s > 0.42) & (end_s < 0.47)
    assert np.median(got.mesh.h_s[sharp]) < 0.3 * np.median(got.mesh.h_s[~sharp])


def test_alike_pieces_are_taken_as_far_as_the_mesh_serves():
    def later_ones_are_rough(h_s, end_s):
        return end_s, np.where(end_s > 2.0 + 1e-9, 1.0, 1e-9)

    got, asked = _play(_request(), later_ones_are_rough, pieces=5)
    assert len(asked) == 1
    assert asked[0].valve.shape == (1, 10)
    assert got.pieces == 2
    assert got.states[0, -1] == pytest.approx(2.0)


def test_a_piece_that_is_rough_is_refined_alone():
    got, asked = _play(_request(), _fourth_order(1.0), pieces=4)
    assert [request.valve.shape[1] for request in asked] == [8, *[2] * (len(asked) - 1)]
    assert got.pieces == 1


def test_steps_that_leave_the_finite_are_halved_and_in_the_end_given_up():
    def needs_short_steps(h_s, end_s):
        return np.where(h_s.max() > 0.03, np.nan, end_s), np.full(h_s.size, 1e-9)

    got, asked = _play(_request(), needs_short_steps)
    assert got.mesh.h_s.max() <= 0.03
    assert len(asked) == 3
    with pytest.raises(NonFiniteMotionError):
        _play(_request(), lambda h_s, end_s: (end_s * np.nan, end_s))


def test_the_error_tells_when():
    def breaks_down(h_s, end_s):
        return np.where(end_s > 0.5 + 1e-9, np.nan, end_s), np.zeros(h_s.size)

    with pytest.raises(NonFiniteMotionError) as caught:
        _play(_request(), breaks_down, settings=MeshSettings(halvings=0))
    assert caught.value.time_s == pytest.approx(0.5)


@pytest.mark.parametrize("attempts", [1, 3])
def test_the_last_attempt_is_taken_as_it_is(attempts):
    got, asked = _play(_request(), lambda h_s, end_s: (end_s, np.ones(h_s.size)), attempts=attempts)
    assert len(asked) == attempts
    assert got.mesh.h_s.size == asked[-1].mesh.h_s.size


def test_after_the_free_attempts_a_mesh_only_gets_finer():
    # all steps but one look far too short in every answer: free to coarsen, the mesh would lose steps
    def one_is_rough(h_s, end_s):
        errors = np.full(h_s.size, 1e-12)
        errors[0] = 1.0
        return end_s, errors

    _, asked = _play(_request(0.01), one_is_rough)
    sizes = [request.mesh.h_s.size for request in asked]
    assert len(sizes) == MeshSettings().attempts
    assert sizes[1] < sizes[0]
    assert all(b >= a for a, b in pairwise(sizes[4:]))


def test_a_wasteful_mesh_is_made_anew():
    errors = _fourth_order(1e-9)
    got, _ = _play(_request(0.001), errors)
    assert got.mesh.h_s.size == 1000
    leaner, asked = _play(_request(0.001), errors, settings=MeshSettings(wasteful=0.3))
    assert len(asked) > 1
    assert leaner.mesh.h_s.size < 300

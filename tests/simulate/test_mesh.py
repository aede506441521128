"""The mesh of integration steps."""

import numpy as np
import pytest

from srs_opt.errors import NoAnswerError
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.settings import STEP

PHASES_S = np.array([0.25, 0.5, 0.25])


def test_a_refined_mesh_keeps_every_phase_s_length():
    mesh = Mesh.uniform(PHASES_S, 0.01)
    error = 1e-6 * np.random.default_rng(1).uniform(0.01, 100.0, mesh.h_s.size)
    finer = mesh.refined(error, 1e-6)
    lengths = np.bincount(finer.phase, weights=finer.h_s)
    assert lengths == pytest.approx(PHASES_S, rel=1e-12)
    assert finer.h_s.min() > 0.0


def test_errors_of_other_steps_tell_where_steps_have_to_be_short():
    h_s, error = np.full(100, 0.01), np.full(100, 1e-6)
    error[40:60] = 81e-6  # local errors go with the fourth power of the step: three times as many steps here
    mesh = Mesh.graded(np.array([0.1, 0.305, 0.0005, 0.5945]), h_s, error, 1e-6)
    lengths = np.bincount(mesh.phase, weights=mesh.h_s)
    assert lengths == pytest.approx([0.1, 0.305, 0.0005, 0.5945], rel=1e-9)
    begins_s = np.cumsum(mesh.h_s) - mesh.h_s
    hard = (begins_s > 0.42) & (begins_s < 0.58)
    easy = (begins_s < 0.35) | (begins_s > 0.65)
    assert mesh.h_s[hard] == pytest.approx(0.01 / 3, rel=0.05)
    assert mesh.h_s[easy] == pytest.approx(0.01, rel=0.05)


def test_a_motion_beyond_any_robot_s_is_refused_before_memory_is_full():
    """A fit's wild trial asked for 21 million steps and 11 GB once."""
    span_s = 10.0
    mesh = Mesh.uniform(span_s * PHASES_S, 0.01)

    def refine_on() -> None:
        nonlocal mesh
        for _ in range(20):
            mesh = mesh.refined(np.full(mesh.h_s.size, 1e6), 1e-9)

    with pytest.raises(NoAnswerError, match="cannot be integrated"):
        refine_on()
    assert 1000 < mesh.h_s.size <= span_s * STEP.most_per_s

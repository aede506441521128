"""The mesh of integration steps."""

import numpy as np
import pytest

from srs_opt.errors import NoAnswerError
from srs_opt.simulate.mesh import MOST_STEPS_PER_S, Mesh

PHASES_S = np.array([0.25, 0.5, 0.25])


def test_a_refined_mesh_keeps_every_phase_s_length():
    mesh = Mesh.uniform(PHASES_S, 0.01)
    error = 1e-6 * np.random.default_rng(1).uniform(0.01, 100.0, mesh.h_s.size)
    finer = mesh.refined(error, 1e-6)
    lengths = np.bincount(finer.phase, weights=finer.h_s)
    assert lengths == pytest.approx(PHASES_S, rel=1e-12)
    assert finer.h_s.min() > 0.0


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
    assert 1000 < mesh.h_s.size <= span_s * MOST_STEPS_PER_S

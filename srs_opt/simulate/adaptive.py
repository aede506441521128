"""Integration on a mesh adapted to the motion: the one loop of attempts that every adaptive driver uses.

Timelines (`simulate.integrate`), orbits (`orbit.solve`) and the trials of a data set
(`calibrate.trial_simulation`) cut time into pieces and keep meshes in their own ways; how a piece's mesh is
made fine enough stands here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.simulate.batched import Search, StepRequest
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.settings import MESH, MeshSettings


class NonFiniteMotionError(NoAnswerError):
    """The motion leaves what numbers can hold `time_s` after the beginning of what was integrated."""

    def __init__(self, time_s: float) -> None:
        super().__init__(
            f"the simulated motion becomes non-finite after {time_s:.3g} s: "
            "check pressure, masses, time constants and effect sizes"
        )
        self.time_s = time_s


@dataclass(frozen=True)
class Adapted:
    """A motion on a mesh that fits it.

    Attributes
    ----------
    states : array (nx, n)
        After each step.
    error_m_s : array (n,)
    mesh : Mesh
        Of one piece.
    pieces : int
        How many of the alike pieces were integrated.
    """

    states: np.ndarray
    error_m_s: np.ndarray
    mesh: Mesh
    pieces: int = 1


def finite_steps(request: StepRequest) -> Search[tuple[np.ndarray, np.ndarray]]:
    """Integrate as asked: states (nx, n) after each step, errors (n,).

    Raises
    ------
    NonFiniteMotionError
        If the state becomes non-finite.
    """
    got = yield request
    # a state that is not finite stays so: the last one tells
    if not np.isfinite(got.states[:, -1]).all():
        bad = int(np.argmax(~np.isfinite(got.states).all(axis=0)))
        raise NonFiniteMotionError(float(request.mesh.h_s[:bad].sum()))
    return got.states, got.error_m_s


def adapted(
    first: StepRequest,
    tolerance: float,
    settings: MeshSettings = MESH,
    *,
    pieces: int = 1,
    attempts: int | None = None,
) -> Search[Adapted]:
    """Integrate one piece on a mesh refined until its steps err by `tolerance`, m/s.

    Parameters
    ----------
    first : StepRequest
        With the mesh that is tried first.
    tolerance : float
        Local error of the body's speed per step.
    pieces : int
        Alike pieces that follow each other, integrated in one call as far as the mesh serves them all. Where
        it does not serve the first, that one alone is refined.
    attempts : int, optional
        Instead of the settings'. With 1 the mesh serves as it is.

    Raises
    ------
    NonFiniteMotionError
        If the motion becomes non-finite even on a finer mesh.
    """
    mesh, valve = first.mesh, first.valve
    last_attempt = (attempts or settings.attempts) - 1
    attempt = halvings = 0
    while True:
        repeated, held = mesh, valve
        if pieces > 1:
            repeated, held = mesh.repeated(pieces, valve.shape[1]), np.tile(valve, pieces)
        request = StepRequest(first.kernel, first.x, repeated, held, first.p)
        try:
            states, errors = yield from finite_steps(request)
        except NonFiniteMotionError:
            # the first piece alone, before its mesh is blamed
            if pieces > 1:
                pieces = 1
            elif halvings < settings.halvings:
                halvings, mesh = halvings + 1, mesh.halved()
            else:
                raise
            continue
        steps = mesh.h_s.size
        worst = errors.reshape(pieces, steps).max(axis=1)
        # how many pieces in a row the mesh served; True at the end stands for all of them
        good = int(np.argmax([*(worst > settings.accepted * tolerance), True]))
        wasted = good and mesh.wanted(errors[:steps], tolerance) < settings.wasteful * steps
        if (good and not wasted) or attempt >= last_attempt:
            # what the last attempt gave is kept although it errs
            done = max(good, 1)
            return Adapted(states[:, : done * steps], errors[: done * steps], mesh, done)
        # with errors raised to the tolerance no step becomes longer
        least = tolerance if attempt >= settings.free_attempts else 0.0
        mesh, pieces = mesh.refined(np.maximum(errors[:steps], least), tolerance), 1
        attempt += 1

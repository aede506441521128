"""One lap of a gait, with the derivative of the body's velocity at its end by that at its start."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.simulate.integrate import Integrator, step_kernel
from srs_opt.simulate.kernel import Kernel
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.rosenbrock import BODY_STATES, VELOCITY, step_function
from srs_opt.simulate.together import Search, Stretch


@dataclass(frozen=True)
class Lapped:
    """What came of a lap.

    Attributes
    ----------
    states : array (nx, n)
        After each step.
    error_m_s : array (n,)
    monodromy : array (3, 3)
        Derivative of the velocity at the end by that at the start.
    """

    states: np.ndarray
    error_m_s: np.ndarray
    monodromy: np.ndarray

    @property
    def velocity(self) -> np.ndarray:
        """Body velocity at the end, (3,)."""
        return self.states[VELOCITY, -1]


def lap(run: Integrator, x: np.ndarray, mesh: Mesh, valve: np.ndarray, p: np.ndarray) -> Search[Lapped]:
    """Integrate over `mesh` with `valve` (N-1, phases) held, from state `x` (nx,)."""
    kernel = monodromy_kernel(run.structure)
    got = yield Stretch(kernel, np.concatenate([x, np.eye(3).ravel()]), mesh, valve, p)
    monodromy = got.states[run.states :, -1].reshape(3, 3, order="F")
    return Lapped(got.states[: run.states], got.error_m_s, monodromy)


def plain_lap(run: Integrator, x: np.ndarray, mesh: Mesh, valve: np.ndarray, p: np.ndarray) -> Search[Lapped]:
    """Integrate as `lap` does, faster, without the derivative (not-a-number)."""
    got = yield Stretch(step_kernel(run.structure), x, mesh, valve, p)
    return Lapped(got.states, got.error_m_s, np.full((3, 3), np.nan))


def monodromy_step(structure: Structure) -> ca.Function:
    """Return ``((x, M), valve, h, p) -> ((x, M)_next, error)``, M = d velocity / d start by columns."""
    step = step_function(structure)
    x, p = ca.SX.sym("x", step.size1_in(0)), ca.SX.sym("p", step.size1_in(3))
    valve, h, m = ca.SX.sym("valve", structure.segments), ca.SX.sym("h"), ca.SX.sym("m", 3, 3)
    x_next, error = step(x, valve, h, p)
    slope = ca.jacobian(x_next[VELOCITY], x)[:, VELOCITY]
    both = ca.vertcat(x_next, ca.vec(slope @ m))
    return ca.Function("monodromy", [ca.vertcat(x, ca.vec(m)), valve, h, p], [both, error], {"cse": True})


@lru_cache(maxsize=32)
def monodromy_kernel(structure: Structure) -> Kernel:
    """Return the compiled `monodromy_step`."""
    parameters, _, actuator = build(structure)
    sizes = (BODY_STATES + actuator.states + 9, structure.segments, parameters.vector.numel())
    return Kernel(f"monodromy {structure}", sizes, lambda: monodromy_step(structure))

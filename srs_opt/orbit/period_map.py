"""The period map of a gait, with the derivative of what it repeats at its end by that at its start.

What a gait repeats are the dynamic states (`StateLayout.dynamic`): the body's velocity, and in the compliant
model the bends and their rates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build, state_layout
from srs_opt.orbit.settings import DIFFERENCE
from srs_opt.simulate.batched import Search, StepRequest
from srs_opt.simulate.integrate import Integrator, step_kernel
from srs_opt.simulate.kernel import LANES, Course, Kernel
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.rosenbrock import VELOCITY, step_function


@dataclass(frozen=True)
class PeriodMap:
    """The state after one period, and its derivative.

    Attributes
    ----------
    states : array (nx, n)
        After each step.
    error_m_s : array (n,)
    dynamic : array (d,)
        Dynamic states at the end.
    monodromy : array (d, d)
        Derivative of the dynamic states at the end by those at the start.
    """

    states: np.ndarray
    error_m_s: np.ndarray
    dynamic: np.ndarray
    monodromy: np.ndarray


def period_map(
    run: Integrator, x: np.ndarray, mesh: Mesh, valve: np.ndarray, p: np.ndarray, scale: np.ndarray
) -> Search[PeriodMap]:
    """Integrate over `mesh` with `valve` (N-1, phases) held, from state `x` (nx,).

    `scale` (d,) makes the dynamic states comparable, as speeds.
    """
    dynamic = run.layout.dynamic
    if run.structure.compliant:
        return _varied(run, x, mesh, valve, p, DIFFERENCE.velocity_m_s / scale)
    kernel = monodromy_kernel(run.structure)
    # d velocity / d start is the identity at the start
    got = yield StepRequest(kernel, np.concatenate([x, np.eye(3).ravel()]), mesh, valve, p)
    # by columns, as CasADi stacks matrices
    monodromy = got.states[run.states :, -1].reshape(3, 3, order="F")
    states = got.states[: run.states]
    return PeriodMap(states, got.error_m_s, states[dynamic, -1], monodromy)


def plain_period_map(
    run: Integrator, x: np.ndarray, mesh: Mesh, valve: np.ndarray, p: np.ndarray
) -> Search[PeriodMap]:
    """Integrate as `period_map` does, faster, without the derivative (not-a-number)."""
    got = yield StepRequest(step_kernel(run.structure), x, mesh, valve, p)
    dynamic = run.layout.dynamic
    unknown = np.full((len(dynamic), len(dynamic)), np.nan)
    return PeriodMap(got.states, got.error_m_s, got.states[dynamic, -1], unknown)


def _varied(
    run: Integrator, x: np.ndarray, mesh: Mesh, valve: np.ndarray, p: np.ndarray, steps: np.ndarray
) -> PeriodMap:
    """Return the period map, its derivative by finite differences of the start.

    On a mesh that is kept the integration is a smooth function of its start, and several starts share each
    call of the compiled step: a third of what tangents cost, and no further code to compile.
    """
    dynamic, kernel = run.layout.dynamic, step_kernel(run.structure)
    starts = np.tile(x, (len(dynamic) + 1, 1))
    starts[1 + np.arange(len(dynamic)), dynamic] += steps
    held, ends = valve.T[mesh.phase], []
    for k in range(0, len(starts), LANES):
        courses = [Course(start, mesh.h_s, held, p) for start in starts[k : k + LANES]]
        states, errors = kernel.run(courses)
        ends.append(states[-1].T)
        if k == 0:
            # the first course is the unperturbed one
            path, error = states[:, :, 0].T, errors[:, 0]
    last = np.concatenate(ends)[:, dynamic]
    return PeriodMap(path, error, last[0], ((last[1:] - last[0]) / steps[:, None]).T)


def monodromy_step(structure: Structure) -> ca.Function:
    """Return ``((x, M), valve, h, p) -> ((x, M)_next, error)``, M = d velocity / d start by columns."""
    step = step_function(structure)
    x, p = ca.SX.sym("x", step.size1_in(0)), ca.SX.sym("p", step.size1_in(3))
    valve, h, m = ca.SX.sym("valve", structure.segments), ca.SX.sym("h"), ca.SX.sym("m", 3, 3)
    x_next, error = step(x, valve, h, p)
    # neither the pose (motion is the same anywhere) nor the actuators (they are prescribed) carry the
    # derivative on
    jacobian = ca.jacobian(x_next[VELOCITY], x)[:, VELOCITY]
    both = ca.vertcat(x_next, ca.vec(jacobian @ m))
    return ca.Function("monodromy", [ca.vertcat(x, ca.vec(m)), valve, h, p], [both, error], {"cse": True})


@lru_cache(maxsize=32)
def monodromy_kernel(structure: Structure) -> Kernel:
    """Return the compiled `monodromy_step` (of models that prescribe the curvature)."""
    parameters, _, _ = build(structure)
    sizes = (state_layout(structure).size + 9, structure.segments, parameters.vector.numel())
    return Kernel(f"monodromy {structure}", sizes, lambda: monodromy_step(structure))


@lru_cache(maxsize=32)
def tangent_kernel(structure: Structure) -> Kernel:
    """Return a step of (x, dx), with the change of the step's length as one more valve, and (p, dp)."""

    def make() -> ca.Function:
        step = step_function(structure)
        x, valve, h, p = (ca.SX.sym(n, step.size1_in(i)) for i, n in enumerate(("x", "valve", "h", "p")))
        dx, dh, dp = ca.SX.sym("dx", x.numel()), ca.SX.sym("dh"), ca.SX.sym("dp", p.numel())
        following, error = step(x, valve, h, p)
        jacobian = ca.jtimes(following, ca.vertcat(x, h, p), ca.vertcat(dx, dh, dp))
        inputs = [ca.vertcat(x, dx), ca.vertcat(valve, dh), h, ca.vertcat(p, dp)]
        return ca.Function("tangent", inputs, [ca.vertcat(following, jacobian), error], {"cse": True})

    nx, np_ = state_layout(structure).size, build(structure)[0].vector.numel()
    return Kernel(f"tangent {structure}", (2 * nx, structure.segments + 1, 2 * np_), make)

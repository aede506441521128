"""A manoeuvre simulated with its exact derivatives by every switch time and the pressure.

The step of the integration is differentiated itself: one pass of compiled code gives all states and the
Jacobian of every step. Moving the switch of one valve by dt changes the state right after it by
[f(valve before) - f(valve after)] dt and nothing else; the Jacobians carry that on to every later node.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import casadi as ca
import numpy as np

from srs_opt.manoeuvre.settings import MANOEUVRE_SOLVER
from srs_opt.manoeuvre.valves import COINCIDENT_S, ValvePlan
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build, state_layout
from srs_opt.orbit.sensitivity import actuator_rates
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.kernel import LANES, Course, Kernel
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.rosenbrock import step_function

Born = dict[int, list[tuple[int, np.ndarray]]]


@dataclass(frozen=True)
class Shot:
    """A simulated manoeuvre.

    Attributes
    ----------
    plan : ValvePlan
    time_s : array (n,)
        Nodes from 0 to the end.
    states : array (n, nx)
    sensitivity : array (n, nx, m) or None
        Derivatives of the states at these instants by every switch time (as `ValvePlan.times` orders them),
        the duration (nonzero at the last node only) and the pressure.
    """

    plan: ValvePlan
    time_s: np.ndarray
    states: np.ndarray
    sensitivity: np.ndarray | None = None


@lru_cache(maxsize=16)
def jacobian_kernel(structure: Structure) -> Kernel:
    """Return a step of x that also leaves its own Jacobian by x and by the pressure behind it."""

    def make() -> ca.Function:
        step = step_function(structure)
        x, valve, h, p = (ca.SX.sym(n, step.size1_in(i)) for i, n in enumerate(("x", "valve", "h", "p")))
        unused = ca.SX.sym("unused", x.numel() * (x.numel() + 1))
        pressure = build(structure)[0].names.index("pressure_kpa")
        following, error = step(x, valve, h, p)
        jacobian = ca.densify(ca.jacobian(following, ca.vertcat(x, p[pressure])))
        both = ca.vertcat(following, ca.vec(jacobian))
        return ca.Function("jacobian", [ca.vertcat(x, unused), valve, h, p], [both, error], {"cse": True})

    nx, count = state_layout(structure).size, build(structure)[0].vector.numel()
    return Kernel(f"step jacobian {structure}", (nx * (nx + 2), structure.segments, count), make)


def shoot(
    run: Integrator, start: np.ndarray, plans: list[ValvePlan], step_s: float | None = None
) -> list[Shot]:
    """Simulate several manoeuvres from one state, side by side; without a step, with the solver's."""
    shots = []
    for k in range(0, len(plans), LANES):
        some = plans[k : k + LANES]
        courses = [_course(run, start, plan, step_s) for plan in some]
        states, _ = run.kernel.run(courses)
        for lane, (plan, course) in enumerate(zip(some, courses)):
            path = np.vstack([start, states[: course.h_s.size, :, lane]])
            shots.append(Shot(plan, np.concatenate([[0.0], np.cumsum(course.h_s)]), path))
    return shots


def shoot_with_sensitivity(
    run: Integrator, start: np.ndarray, plan: ValvePlan, step_s: float | None = None
) -> Shot:
    """Simulate a manoeuvre and differentiate it."""
    course = _course(run, start, plan, step_s)
    found, _ = run.kernel.run([course])
    states = np.vstack([start, found[:, :, 0]])
    time = np.concatenate([[0.0], np.cumsum(course.h_s)])
    m = plan.switches + 2
    born: Born = {}
    column = 0
    for segment, row in enumerate(plan.rows):
        for k, at in enumerate(row.times_s):
            if -COINCIDENT_S <= at < plan.duration_s - COINCIDENT_S:
                node = int(np.argmin(np.abs(time - at)))
                after = course.valve[node].copy()
                # the state, in part where the pressure is lower
                share = after[segment] / row.states[k + 1] if after[segment] else 1.0
                before = after.copy()
                before[segment] = share * row.states[k]
                jump = jump_of(run, states[node], course.p, before, after)
                born.setdefault(node, []).append((column, jump))
            column += 1
    by_pressure = np.zeros((course.h_s.size, m))
    # the last unknown is the pressure itself, in every step
    by_pressure[:, -1] = 1.0
    sensitivity = carried_on(run, course, states, born, by_pressure)
    # f at the end, from the last step itself: a finite difference would see the step's curvature
    sensitivity[-1, :, -2] = (states[-1] - states[-2]) / course.h_s[-1]
    return Shot(plan, time, states, sensitivity)


def carried_on(
    run: Integrator, course: Course, states: np.ndarray, born: Born, by_pressure: np.ndarray
) -> np.ndarray:
    """Return the derivatives of all states (n + 1, nx, m) by m unknowns.

    Parameters
    ----------
    course : Course
    states : array (n + 1, nx)
        Where it leads, the start first.
    born : dict of node to list of (unknown, jump (nx,))
        What an unknown does to the state at the instant that it moves.
    by_pressure : array (n, m)
        How much an unknown changes the course's pressure in each step.
    """
    nx, m = run.states, by_pressure.shape[1]
    jacobians = _jacobians(run, course, states)
    sensitivity = np.zeros((len(states), nx, m))
    for node, jacobian in enumerate(jacobians):
        for column, jump in born.get(node, ()):
            sensitivity[node, :, column] += jump
        # first what is born at the node, then the step that carries it on
        sensitivity[node + 1] = jacobian[:, :nx] @ sensitivity[node]
        sensitivity[node + 1] += jacobian[:, nx, None] * by_pressure[node]
    return sensitivity


def _jacobians(run: Integrator, course: Course, states: np.ndarray) -> np.ndarray:
    """Return every step's Jacobian by state and pressure (n, nx, nx + 1), LANES parts of the way at once."""
    nx, n = run.states, course.h_s.size
    # all states are known already, so no part of the way has to wait for the one before
    cuts = np.unique(np.linspace(0, n, LANES + 1).astype(int))
    parts = [
        Course(np.append(states[a], np.zeros(nx * (nx + 1))), course.h_s[a:b], course.valve[a:b], course.p)
        for a, b in pairwise(cuts)
    ]
    found, _ = jacobian_kernel(run.structure).run(parts)
    columns = [found[: part.h_s.size, nx:, lane] for lane, part in enumerate(parts)]
    # by columns, as CasADi stacks matrices
    jacobian: np.ndarray = np.concatenate(columns).reshape(n, nx + 1, nx).transpose(0, 2, 1)
    return jacobian


def _course(run: Integrator, start: np.ndarray, plan: ValvePlan, step_s: float | None) -> Course:
    timeline = plan.timeline().at_one_pressure()
    # one step per phase at least, so that none straddles a switch
    mesh = Mesh.uniform(timeline.duration_s, step_s or MANOEUVRE_SOLVER.step_s, 1)
    # a manoeuvre has no frequency, and robots with effects that go by one are refused: any will do
    p = run.pack(float(timeline.pressure_kpa[0]), 1.0)
    return Course(start, mesh.h_s, timeline.valve.T[mesh.phase], p)


def jump_of(
    run: Integrator, state: np.ndarray, p: np.ndarray, before: np.ndarray, after: np.ndarray
) -> np.ndarray:
    """Return the change of the state per time by which valves (N-1,) go later from one state to another."""
    rates = actuator_rates(run.structure)
    act = state[run.layout.actuator]
    both = np.asarray(rates(np.tile(act[:, None], 2), np.stack([before, after], axis=1), p))
    jump = np.zeros(state.size)
    jump[run.layout.actuator] = both[:, 0] - both[:, 1]
    return jump

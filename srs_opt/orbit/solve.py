"""Newton on one period: the body velocity that a gait repeats, pose removed.

The curvature's periodic state is known first (closed form where the actuators are linear), so only
the three velocities at the start of the cycle are unknown; their 3 x 3 monodromy matrix is carried
through the period with the exact derivative of every integration step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.model.parameters import Structure
from srs_opt.orbit.laps import Lapped, lap, plain_lap
from srs_opt.simulate.integrate import LOOSE, TOLERANCE_M_S, Integrator
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.rosenbrock import BODY_STATES
from srs_opt.simulate.tableau import LEVER_M
from srs_opt.simulate.together import Search

_NEWTON_STEPS = 30
_CLOSED_M_S = 1e-9
_WARM_UP_PERIODS = 2
_SETTLING_PERIODS, _REFINEMENTS = 10, 4
_SETTLE_PERIODS = 5
_EVEN_STEP_S = 0.004
_ROUGH_M_S = 1e-3
_MESHES = 4


@dataclass(frozen=True)
class PeriodicSolution:
    """One period of the orbit: states at the nodes, the mesh, and the velocity's monodromy matrix.

    Attributes
    ----------
    start : array (nx,)
        State at time 0, pose zero.
    states : array (nx, n)
        States after each step of `mesh`.
    monodromy : array (3, 3)
        Of (u_x, u_y, yaw rate x lever), so that entries compare.
    residual_m_s : float
        By how much the velocity fails to repeat.
    """

    start: np.ndarray
    states: np.ndarray
    mesh: Mesh
    valve: np.ndarray
    monodromy: np.ndarray
    residual_m_s: float


def periodic_actuators(run: Integrator, gait: Gait, p: np.ndarray) -> np.ndarray:
    """Return the actuators' periodic state at time 0 (closed form where linear, else by settling)."""
    durations, valves = gait.phases()
    hold = _hold_function(run.structure)
    n, s = run.actuator.states, run.structure.segments
    if run.actuator.linear:
        # the answers of every phase to no state, to curvature one and to rate one, in one call
        units = np.zeros((n, 3))
        units[:s, 1] = units[s:, 2] = 1.0
        count = durations.size
        ends = np.asarray(
            hold(np.tile(units, count), np.repeat(valves, 3, axis=1), np.repeat(durations, 3)[None, :], p)
        )
        none, bent, bending = ends.reshape(2, s, count, 3).transpose(3, 2, 0, 1)
        state, decay = np.zeros((2, s)), np.eye(2)
        for forced, one, two in zip(none, bent - none, bending - none):
            stay = np.column_stack([one[:, 0], two[:, 0]])  # segments are alike
            state, decay = forced + stay @ state, stay @ decay
        return np.asarray(np.linalg.solve(np.eye(2) - decay, state)).ravel()
    fine = np.maximum(np.ceil(durations / 0.0025).astype(int), 2)
    act = np.zeros(n)
    for _ in range(200):
        following = act
        for h, valve, k in zip(durations, valves.T, fine):
            for _ in range(k):
                following = np.asarray(hold(following, valve, h / k, p)).ravel()
        if np.abs(following - act).max() <= 1e-9 * (1 + np.abs(act).max()):
            return following
        act = following
    raise NoAnswerError("the curvature does not settle into a cycle within 200 periods under this gait")


@lru_cache(maxsize=32)
def _hold_function(structure: Structure) -> ca.Function:
    from srs_opt.model.registry import build

    parameters, _, actuator = build(structure)
    act, valve, h = ca.SX.sym("act", actuator.states), ca.SX.sym("valve", structure.segments), ca.SX.sym("h")
    after = actuator.advance(actuator.unstack(act), valve, h).vector()
    return ca.Function("hold", [act, valve, h, parameters.vector], [after], {"cse": True})


def search_orbit(
    run: Integrator, gait: Gait, tolerance: float = TOLERANCE_M_S, guess: np.ndarray | None = None
) -> Search[PeriodicSolution]:
    """Search the periodic orbit of `gait`.

    Parameters
    ----------
    guess : array (3,), optional
        Body velocity at time 0 to start from (continuation); without it, two periods are simulated from rest.

    Raises
    ------
    NoAnswerError
        If the velocity does not close on itself.
    """
    cycle = _Cycle.of(run, gait)
    mesh = Mesh.uniform(cycle.durations_s, _EVEN_STEP_S)
    try:
        velocity = np.zeros(3) if guess is None else guess
        for _ in range(_WARM_UP_PERIODS if guess is None else 0):
            velocity = (yield from cycle.plain_lap(velocity, mesh)).velocity
        return (yield from _closed(cycle, velocity, mesh, tolerance))
    except NoAnswerError:  # a misleading guess, or even steps too long for this motion
        velocity, mesh = yield from _settled(cycle, mesh, tolerance)
        try:
            return (yield from _closed(cycle, velocity, mesh, tolerance, adapted=True))
        except NoAnswerError:
            return (yield from _closed(cycle, velocity, mesh, tolerance))


@dataclass(frozen=True)
class _Cycle:
    """What stays the same while the orbit of one gait is searched."""

    run: Integrator
    gait: Gait
    durations_s: np.ndarray
    valve: np.ndarray
    act: np.ndarray
    p: np.ndarray
    scale: np.ndarray  # makes the velocity's three entries comparable

    @staticmethod
    def of(run: Integrator, gait: Gait) -> _Cycle:
        p = run.pack(gait.pressure_kpa, gait.frequency_hz)
        act = periodic_actuators(run, gait, p)
        scale = np.array([1.0, 1.0, LEVER_M / _inertia(run, act, p)])
        return _Cycle(run, gait, *gait.phases(), act, p, scale)

    def start(self, velocity: np.ndarray) -> np.ndarray:
        return np.concatenate([np.zeros(3), velocity, np.zeros(BODY_STATES - 6), self.act])

    def lap(self, velocity: np.ndarray, mesh: Mesh) -> Search[Lapped]:
        return lap(self.run, self.start(velocity), mesh, self.valve, self.p)

    def plain_lap(self, velocity: np.ndarray, mesh: Mesh) -> Search[Lapped]:
        return plain_lap(self.run, self.start(velocity), mesh, self.valve, self.p)

    def no_answer(self, why: str) -> NoAnswerError:
        at = f"{self.gait.frequency_hz:.3g} Hz, {self.gait.pressure_kpa:.3g} kPa"
        return NoAnswerError(f"no steady gait found at {at}: {why}")

    def size(self, velocity_change: np.ndarray) -> float:
        return float(np.linalg.norm(self.scale * velocity_change))


def _closed(
    cycle: _Cycle, velocity: np.ndarray, mesh: Mesh, tolerance: float, *, adapted: bool = False
) -> Search[PeriodicSolution]:
    """Return the orbit near `velocity`, on meshes that fit its motion better and better.

    A mesh that is `adapted` already is never made coarser: this motion needs it.
    """
    total = 0
    lapped: Lapped | None = None
    # an even mesh finds the orbit roughly; only there is the mesh worth adapting (friction's sharp
    # features move with the motion), then Newton finishes on the adapted mesh
    goals = [_CLOSED_M_S] * _MESHES if adapted else [_ROUGH_M_S, *[_CLOSED_M_S] * _MESHES]
    for attempt, goal_m_s in enumerate(goals):
        if lapped is not None:
            wanted = tolerance / attempt  # finer each time, so that this ends
            mesh = mesh.refined(np.maximum(lapped.error_m_s, wanted if adapted else 0.0), wanted)
        velocity, lapped, count = yield from _newton(cycle, velocity, mesh, goal_m_s)
        total += count
        size = cycle.size(lapped.velocity - velocity)
        closed = size <= max(goal_m_s, 1e-6)
        if not closed and (attempt == len(goals) - 1 or not size <= _ROUGH_M_S):
            raise cycle.no_answer(
                f"after {total} Newton steps the body's speed still changes by {size:.2g} m/s per cycle"
            )
        if closed and goal_m_s == _CLOSED_M_S and lapped.error_m_s.max() <= LOOSE * tolerance:
            break
    assert lapped is not None
    monodromy = cycle.scale[:, None] * lapped.monodromy / cycle.scale
    return PeriodicSolution(cycle.start(velocity), lapped.states, mesh, cycle.valve, monodromy, size)


def _newton(
    cycle: _Cycle, velocity: np.ndarray, mesh: Mesh, goal_m_s: float
) -> Search[tuple[np.ndarray, Lapped, int]]:
    """Return velocity, the lap from it, and how many steps it took; settles where Newton stalls."""
    lapped = yield from cycle.lap(velocity, mesh)
    count = 0
    while (size := cycle.size(lapped.velocity - velocity)) > goal_m_s and count < _NEWTON_STEPS:
        count += 1
        step = _newton_direction(lapped.monodromy, lapped.velocity - velocity)
        for factor in (1.0, 0.3, 0.1) if np.isfinite(step).all() else ():
            trial = velocity + factor * step
            there = yield from cycle.lap(trial, mesh)
            if cycle.size(there.velocity - trial) < (1 - 0.1 * factor) * size:
                break
        else:  # no descent along Newton's direction: let the motion itself settle
            trial = velocity
            for _ in range(_SETTLE_PERIODS):
                trial = (yield from cycle.plain_lap(trial, mesh)).velocity
            there = yield from cycle.lap(trial, mesh)
        velocity, lapped = trial, there
    return velocity, lapped, count


def _newton_direction(m: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Return Newton's step, not-a-number where the monodromy matrix says nothing."""
    try:
        return np.asarray(np.linalg.solve(np.eye(3) - m, residual))
    except np.linalg.LinAlgError:
        return np.full(3, np.nan)


def _settled(cycle: _Cycle, mesh: Mesh, tolerance: float) -> Search[tuple[np.ndarray, Mesh]]:
    """Return the velocity after some periods from rest and a mesh on which that motion is accurate."""
    velocity, mesh = np.zeros(3), mesh.halved().halved()
    for _ in range(_SETTLING_PERIODS):
        for _ in range(_REFINEMENTS):
            lapped = yield from cycle.plain_lap(velocity, mesh)
            if not np.isfinite(lapped.states[:, -1]).all():
                raise cycle.no_answer(
                    "the motion stops being finite; check pressure, masses, time constants and effect sizes"
                )
            if lapped.error_m_s.max() <= LOOSE * tolerance:
                break
            mesh = mesh.refined(lapped.error_m_s, tolerance)
        velocity = lapped.velocity
    return velocity, mesh


@lru_cache(maxsize=32)
def _inertia_function(structure: Structure) -> ca.Function:
    from srs_opt.model.registry import build

    parameters, mechanics, _ = build(structure)
    outputs = [mechanics.yaw_inertia(), mechanics.yaw_momentum_of_shape()]
    return ca.Function(
        "inertia", [mechanics.kappa, mechanics.dkappa, parameters.vector], outputs, {"cse": True}
    )


def _inertia(run: Integrator, act: np.ndarray, p: np.ndarray) -> float:
    s = run.structure.segments
    return float(_inertia_function(run.structure)(act[:s], act[s : 2 * s], p)[0])

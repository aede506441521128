"""Newton on one period: the dynamic states that a gait repeats, pose removed.

The actuators' periodic state is known first (closed form where they are linear), so only the dynamic states
at the start of the cycle are unknown: the body's three velocities, and in the compliant model the bends and
their rates. Their monodromy matrix is carried through the period with the exact derivative of every
integration step; for the compliant model's many by finite differences, on the same mesh.

A soft body can have several stable orbits under one gait, so there the orbit is the one that is reached from
rest: the motion is simulated until it has all but settled, and Newton only finishes it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.model.state import POSE, WORK
from srs_opt.model.yaw import yaw_momenta
from srs_opt.orbit.actuators import periodic_actuators
from srs_opt.orbit.period_map import PeriodMap, period_map, plain_period_map
from srs_opt.orbit.settings import ORBIT
from srs_opt.simulate.adaptive import NonFiniteMotionError, adapted
from srs_opt.simulate.batched import Search, StepRequest
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.mesh import Mesh
from srs_opt.simulate.settings import INTEGRATION, MESH
from srs_opt.simulate.tableau import LEVER_M


@dataclass(frozen=True)
class PeriodicSolution:
    """One period of the orbit: states at the nodes, the mesh, and the velocity's monodromy matrix.

    Attributes
    ----------
    start : array (nx,)
        State at time 0, pose zero.
    states : array (nx, n)
        States after each step of `mesh`.
    monodromy : array (d, d)
        Of the dynamic states, scaled so that entries compare.
    residual_m_s : float
        By how much they fail to repeat.
    """

    start: np.ndarray
    states: np.ndarray
    mesh: Mesh
    valve: np.ndarray
    monodromy: np.ndarray
    residual_m_s: float

    @property
    def largest_multiplier(self) -> float:
        """Largest modulus of the Floquet multipliers; below 1: stable."""
        return float(np.abs(np.linalg.eigvals(self.monodromy)).max())


def search_orbit(
    run: Integrator, gait: Gait, tolerance: float | None = None, guess: np.ndarray | None = None
) -> Search[PeriodicSolution]:
    """Search the periodic orbit of `gait`.

    Parameters
    ----------
    tolerance : float, optional
        By default that of `INTEGRATION`.
    guess : array (d,), optional
        Dynamic states at time 0 to start from (continuation). Without it two periods are simulated from rest;
        in the compliant model the gait is played from rest until it settles.

    Raises
    ------
    NoAnswerError
        If the motion does not close on itself.
    """
    tolerance = INTEGRATION.tolerance_m_s if tolerance is None else tolerance
    cycle = Cycle.of(run, gait)
    mesh = Mesh.uniform(cycle.durations_s, ORBIT.first_step_s)
    if run.structure.compliant and guess is None:
        return (yield from _reached_from(cycle, run.rest(), mesh, tolerance))
    try:
        dynamic = np.zeros(len(run.layout.dynamic)) if guess is None else guess
        for _ in range(ORBIT.warm_up_periods if guess is None else 0):
            dynamic = (yield from cycle.plain_period_map(dynamic, mesh)).dynamic
        return (yield from _closed(cycle, dynamic, mesh, tolerance))
    except NoAnswerError:  # a misleading guess, or even steps too long for this motion
        if run.structure.compliant:
            return (yield from _reached_from(cycle, run.rest(), mesh, tolerance))
        dynamic, mesh = yield from _settled(cycle, mesh, tolerance)
        try:
            return (yield from _closed(cycle, dynamic, mesh, tolerance, adapted=True))
        except NoAnswerError:
            return (yield from _closed(cycle, dynamic, mesh, tolerance))


def reached_from(
    run: Integrator, gait: Gait, dynamic: np.ndarray, tolerance: float | None = None
) -> Search[PeriodicSolution]:
    """Search the orbit that `gait` leads to from given dynamic states at time 0, actuators on their cycle.

    Raises
    ------
    NoAnswerError
        If the motion does not settle.
    """
    tolerance = INTEGRATION.tolerance_m_s if tolerance is None else tolerance
    cycle = Cycle.of(run, gait)
    mesh = Mesh.uniform(cycle.durations_s, ORBIT.first_step_s)
    return (yield from _reached_from(cycle, cycle.start(dynamic), mesh, tolerance))


def _reached_from(cycle: Cycle, x: np.ndarray, mesh: Mesh, tolerance: float) -> Search[PeriodicSolution]:
    """Return the orbit that the motion from state `x` settles into.

    Newton's orbit counts only if it is stable and near the motion that has all but settled: otherwise the
    motion goes on, to be tried again where it changes ten times less from cycle to cycle.
    """
    settled, goal = 0, ORBIT.nearly_m_s
    before = x[cycle.run.layout.dynamic]
    for count in range(ORBIT.most_periods):
        end, mesh = yield from _accurate_period_map(cycle, x, mesh, tolerance)
        x = end.copy()
        # motion is the same from any pose: numbers stay small however long it takes
        x[POSE], x[WORK] = 0.0, 0.0
        after = x[cycle.run.layout.dynamic]
        change, before = cycle.size(after - before), after
        settled = settled + 1 if change < goal else 0
        if settled < ORBIT.quiet_periods:
            continue
        try:
            found = yield from _closed(cycle, before, mesh, tolerance, adapted=True)
        except NoAnswerError:
            if count > ORBIT.most_periods // 2:
                raise
        else:
            away = cycle.size(found.start[cycle.run.layout.dynamic] - before)
            largest = found.largest_multiplier
            # what is left to go: the changes to come are a geometric series
            if largest < 1 and away <= ORBIT.same_m_s + min(
                ORBIT.nearness * change / (1 - largest), ORBIT.farthest_m_s
            ):
                return found
        goal = change / 10
    raise cycle.no_answer(
        f"the motion still changes by {change:.2g} m/s from cycle to cycle after "
        f"{ORBIT.most_periods} cycles; it does not repeat with the gait's period"
    )


def _accurate_period_map(
    cycle: Cycle, x: np.ndarray, mesh: Mesh, tolerance: float
) -> Search[tuple[np.ndarray, Mesh]]:
    """Return the state one period after state `x`, and a mesh that is fine enough for that motion."""
    request = StepRequest(cycle.run.kernel, x, mesh, cycle.valve, cycle.p)
    settings = replace(MESH, free_attempts=ORBIT.free_attempts, attempts=ORBIT.attempts)
    try:
        got = yield from adapted(request, tolerance, settings)
    except NonFiniteMotionError:
        raise cycle.no_answer(
            "the motion becomes non-finite; check pressure, masses, time constants and effect sizes"
        ) from None
    return got.states[:, -1], got.mesh


@dataclass(frozen=True)
class Cycle:
    """What stays the same while the orbit of one gait is searched."""

    run: Integrator
    gait: Gait
    durations_s: np.ndarray
    valve: np.ndarray
    act: np.ndarray
    p: np.ndarray
    scale: np.ndarray  # makes the dynamic states comparable, as speeds

    @staticmethod
    def of(run: Integrator, gait: Gait) -> Cycle:
        """Return the cycle of `gait`, with the actuators' periodic state."""
        p = run.pack(gait.pressure_kpa, gait.frequency_hz)
        act = periodic_actuators(run, gait, p)
        # yaw momentum to yaw rate to the speed of a point LEVER_M away; bends as speeds of that point
        scale = np.array([1.0, 1.0, LEVER_M / _inertia(run, act, p)])
        if run.structure.compliant:
            bend = LEVER_M * run.robot.segment_length_m * np.ones(run.structure.segments)
            scale = np.concatenate([scale, bend / ORBIT.bend_time_s, bend])
        return Cycle(run, gait, *gait.phases(), act, p, scale)

    def start(self, dynamic: np.ndarray) -> np.ndarray:
        """Return the state at time 0 with the actuators on their cycle."""
        x = np.zeros(self.run.states)
        x[self.run.layout.dynamic] = dynamic
        x[self.run.layout.actuator] = self.act
        return x

    def period_map(self, dynamic: np.ndarray, mesh: Mesh) -> Search[PeriodMap]:
        """Return the period map with its monodromy matrix."""
        return period_map(self.run, self.start(dynamic), mesh, self.valve, self.p, self.scale)

    def plain_period_map(self, dynamic: np.ndarray, mesh: Mesh) -> Search[PeriodMap]:
        """Return the period map without derivative."""
        return plain_period_map(self.run, self.start(dynamic), mesh, self.valve, self.p)

    def no_answer(self, why: str) -> NoAnswerError:
        """Return the error that names the gait."""
        at = f"{self.gait.frequency_hz:.3g} Hz, {self.gait.pressure_kpa:.3g} kPa"
        return NoAnswerError(f"no steady gait found at {at}: {why}")

    def size(self, change: np.ndarray) -> float:
        """Return the norm of a change of the dynamic states, m/s."""
        return float(np.linalg.norm(self.scale * change))


def _closed(
    cycle: Cycle, dynamic: np.ndarray, mesh: Mesh, tolerance: float, *, adapted: bool = False
) -> Search[PeriodicSolution]:
    """Return the orbit near `dynamic`, on meshes that fit its motion better and better.

    A mesh that is `adapted` already is never made coarser: this motion needs it.
    """
    total = 0
    mapped: PeriodMap | None = None
    # an even mesh finds the orbit roughly; only there is the mesh worth adapting (friction's sharp
    # features move with the motion), then Newton finishes on the adapted mesh
    goals = (
        [ORBIT.closed_m_s] * ORBIT.meshes
        if adapted
        else [ORBIT.rough_m_s, *[ORBIT.closed_m_s] * ORBIT.meshes]
    )
    for attempt, goal_m_s in enumerate(goals):
        if mapped is not None:
            wanted = tolerance / attempt  # finer each time, so that this ends
            mesh = mesh.refined(np.maximum(mapped.error_m_s, wanted if adapted else 0.0), wanted)
        dynamic, mapped, count = yield from _newton(cycle, dynamic, mesh, goal_m_s)
        total += count
        size = cycle.size(mapped.dynamic - dynamic)
        # where rounding holds Newton above its goal, 1e-6 m/s still counts as closed
        closed = size <= max(goal_m_s, 1e-6)
        if not closed and (attempt == len(goals) - 1 or not size <= ORBIT.rough_m_s):
            raise cycle.no_answer(
                f"after {total} Newton steps the body's speed still changes by {size:.2g} m/s per cycle"
            )
        if closed and goal_m_s == ORBIT.closed_m_s and mapped.error_m_s.max() <= MESH.accepted * tolerance:
            break
    assert mapped is not None
    # a similarity transform: multipliers stay, entries become comparable
    monodromy = cycle.scale[:, None] * mapped.monodromy / cycle.scale
    return PeriodicSolution(cycle.start(dynamic), mapped.states, mesh, cycle.valve, monodromy, size)


def _newton(
    cycle: Cycle, dynamic: np.ndarray, mesh: Mesh, goal_m_s: float
) -> Search[tuple[np.ndarray, PeriodMap, int]]:
    """Return dynamic states, the period map there and the number of steps; settles where Newton stalls."""
    mapped = yield from cycle.period_map(dynamic, mesh)
    count = 0
    while (size := cycle.size(mapped.dynamic - dynamic)) > goal_m_s and count < ORBIT.newton_steps:
        count += 1
        step = _newton_direction(mapped.monodromy, mapped.dynamic - dynamic)
        for factor in (1.0, 0.3, 0.1) if np.isfinite(step).all() else ():
            trial = dynamic + factor * step
            there = yield from cycle.period_map(trial, mesh)
            # sufficient decrease; not-a-number fails it, too
            if cycle.size(there.dynamic - trial) < (1 - 0.1 * factor) * size:
                break
        else:  # no descent along Newton's direction: let the motion itself settle
            trial = dynamic
            for _ in range(ORBIT.settle_periods):
                trial = (yield from cycle.plain_period_map(trial, mesh)).dynamic
            there = yield from cycle.period_map(trial, mesh)
        dynamic, mapped = trial, there
    return dynamic, mapped, count


def _newton_direction(m: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Return Newton's step, not-a-number where the monodromy matrix says nothing."""
    try:
        # z = G(z): (I - dG/dz) dz = G(z) - z
        return np.asarray(np.linalg.solve(np.eye(len(m)) - m, residual))
    except np.linalg.LinAlgError:
        return np.full(len(m), np.nan)


def _settled(cycle: Cycle, mesh: Mesh, tolerance: float) -> Search[tuple[np.ndarray, Mesh]]:
    """Return the dynamic states after some periods from rest and a mesh on which that motion is accurate."""
    # the even steps may have been too long for this motion
    dynamic, mesh = np.zeros(len(cycle.run.layout.dynamic)), mesh.halved().halved()
    for _ in range(ORBIT.settling_periods):
        end, mesh = yield from _accurate_period_map(cycle, cycle.start(dynamic), mesh, tolerance)
        dynamic = end[cycle.run.layout.dynamic]
    return dynamic, mesh


def _inertia(run: Integrator, act: np.ndarray, p: np.ndarray) -> float:
    # a body whose bends are those without load
    x = np.zeros(run.states)
    x[run.layout.actuator] = act
    x[run.layout.kappa] = act[: run.structure.segments]
    return float(yaw_momenta(run.structure)(x, p)[0])

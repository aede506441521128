"""The actuators' cycle under a gait: known before the motion, in closed form where they are linear."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.orbit.settings import DIFFERENCE, ORBIT
from srs_opt.simulate.integrate import Integrator


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
            # (curvature, rate) after a phase is affine in those before: forced + stay (kappa, kappa')
            state, decay = forced + stay @ state, stay @ decay
        # the fixed point of one period, x = decay x + state
        return np.asarray(np.linalg.solve(np.eye(2) - decay, state)).ravel()
    fine = _fine(durations)
    act = np.zeros(n)
    for _ in range(ORBIT.most_periods):
        following = act
        for h, valve, k in zip(durations, valves.T, fine):
            for _ in range(k):
                following = np.asarray(hold(following, valve, h / k, p)).ravel()
        if np.abs(following - act).max() <= 1e-9 * (1 + np.abs(act).max()):
            return following
        act = following
    raise NoAnswerError(
        f"the curvature does not settle into a cycle within {ORBIT.most_periods} periods under this gait"
    )


def actuator_multiplier(run: Integrator, gait: Gait, act: np.ndarray, p: np.ndarray) -> float:
    """Return the largest modulus of the actuators' Floquet multipliers about their cycle.

    exp(-period / max tau) where they are linear; else the spectral radius of d act(period) / d act(0), by
    central differences.

    Parameters
    ----------
    act : array (n,)
        The periodic state at time 0.
    p : array (np,)
        As packed by the integrator.
    """
    if run.actuator.linear:
        return float(np.exp(-gait.period_s / max(run.robot.tau1_s, run.robot.tau2_s)))
    durations, valves = gait.phases()
    hold = _hold_function(run.structure)
    # all perturbed states at once, as columns of one call
    steps = DIFFERENCE.actuator * (1 + np.abs(act))
    ends = act[:, None] + np.hstack([np.diag(steps), -np.diag(steps)])
    for h, valve, k in zip(durations, valves.T, _fine(durations)):
        for _ in range(k):
            ends = np.asarray(hold(ends, valve, h / k, p))
    monodromy = (ends[:, : act.size] - ends[:, act.size :]) / (2 * steps)
    return float(np.abs(np.linalg.eigvals(monodromy)).max())


def _fine(durations: np.ndarray) -> np.ndarray:
    """Return how many steps of the integration each phase takes where no closed form exists."""
    steps: np.ndarray = np.maximum(np.ceil(durations / ORBIT.actuator_step_s).astype(int), 2)
    return steps


@lru_cache(maxsize=32)
def _hold_function(structure: Structure) -> ca.Function:
    parameters, _, actuator = build(structure)
    act, valve, h = ca.SX.sym("act", actuator.states), ca.SX.sym("valve", structure.segments), ca.SX.sym("h")
    after = actuator.advance(actuator.unstack(act), valve, h).vector()
    return ca.Function("hold", [act, valve, h, parameters.vector], [after], {"cse": True})

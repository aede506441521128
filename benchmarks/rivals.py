"""Other ways to integrate the same snake: the C loop, SciPy's solvers, CVODES, each from switch to switch."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import casadi as ca
import numpy as np

from srs_opt.gait import Gait, Wave
from srs_opt.model.parameters import Structure
from srs_opt.model.registry import build
from srs_opt.robot import Robot
from srs_opt.simulate.compiled import compiled, compiler
from srs_opt.simulate.zero_copy import ZeroCopy


@lru_cache(maxsize=1)
def _c_program() -> Path:
    cc = compiler()
    if cc is None:
        raise RuntimeError("the floor needs a C compiler")
    program = Path(tempfile.mkdtemp(prefix="c_loop")) / "c_loop"
    source = Path(__file__).parent / "c_loop.c"
    subprocess.run([*cc[0], "-O3", str(source), "-o", str(program), "-lm"], check=True)
    return program


def c_loop(wave: Wave, lag_rad: float, duration_s: float, step_s: float) -> tuple[float, np.ndarray]:
    """Return the C loop's time, s, and what the last cycle did: (chord m, turn rad)."""
    numbers = (wave.frequency_hz, wave.pressure_kpa, lag_rad, wave.offset[0], duration_s, step_s)
    command = [str(_c_program()), *(repr(float(n)) for n in numbers)]
    seconds, chord, turn, _ = map(
        float, subprocess.run(command, capture_output=True, check=True).stdout.split()
    )
    return seconds, np.array([chord, turn])


def last_cycle(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return (chord m, turn rad) between two poses."""
    return np.array([np.hypot(*(end[:2] - start[:2])), end[2] - start[2]])


def _ode(robot: Robot) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Return state (pose, velocity, curvature and rate), valve, parameters and the state's rate."""
    parameters, m, actuator = build(Structure.of(robot))
    pose, velocity = ca.SX.sym("pose", 3), ca.SX.sym("velocity", 3)
    valve = ca.SX.sym("valve", m.links - 1)
    act = actuator.unstack(ca.vertcat(m.kappa, m.dkappa))
    rate, _ = m.velocity_rate(pose, velocity)
    rates = ca.vertcat(m.pose_rate(pose, velocity), rate, actuator.rates(act, valve).vector())
    return ca.vertcat(pose, velocity, m.kappa, m.dkappa), valve, parameters.vector, rates


Rival = Callable[[np.ndarray, np.ndarray, float], np.ndarray]


def _compiled(robot: Robot, name: str, inputs: list[ca.SX], value: ca.SX) -> ZeroCopy:
    key = f"benchmark {name} {Structure.of(robot)}"
    return ZeroCopy(compiled(key, lambda: ca.Function(name, inputs, [value], {"cse": True})))


def scipy_rival(robot: Robot, p: np.ndarray, method: str, tolerance: float) -> Rival:
    """Return ``(state, valve, duration) -> state`` by solve_ivp, right-hand side and Jacobian compiled."""
    from scipy.integrate import solve_ivp

    x, valve, parameters, rates = _ode(robot)
    f = _compiled(robot, "rates", [x, valve, parameters], rates)
    j = _compiled(robot, "jacobian", [x, valve, parameters], ca.densify(ca.jacobian(rates, x)))

    def call(function: ZeroCopy, state: np.ndarray, valves: np.ndarray) -> np.ndarray:
        function.arguments[0][0], function.arguments[1][0], function.arguments[2][0] = state, valves, p
        function.evaluate()
        return function.results[0]

    def advance(state: np.ndarray, valves: np.ndarray, duration: float) -> np.ndarray:
        solution = solve_ivp(
            lambda _, y: call(f, y, valves)[0].copy(), (0.0, duration), state, method=method,
            jac=lambda _, y: call(j, y, valves).T.copy(), rtol=tolerance, atol=tolerance * 1e-3,
        )  # fmt: skip
        return solution.y[:, -1]

    return advance


def cvodes_rival(robot: Robot, p: np.ndarray, tolerance: float) -> Rival:
    """Return ``(state, valve, duration) -> state`` by CasADi's CVODES (time scaled to the phase)."""
    x, valve, parameters, rates = _ode(robot)
    duration = ca.SX.sym("duration")
    problem = {"x": x, "p": ca.vertcat(valve, parameters, duration), "ode": rates * duration}
    options = {"reltol": tolerance, "abstol": tolerance * 1e-3, "max_num_steps": 100000}
    integrate = ca.integrator("cvodes", "cvodes", problem, 0.0, 1.0, options)

    def advance(state: np.ndarray, valves: np.ndarray, seconds: float) -> np.ndarray:
        return np.asarray(integrate(x0=state, p=np.r_[valves, p, seconds])["xf"]).ravel()

    return advance


def drive(rival: Rival, gait: Gait, cycles: int) -> np.ndarray:
    """Run a rival from rest over whole cycles; return the last cycle's (chord, turn)."""
    state = np.zeros(6 + 2 * gait.segments)
    durations, valves = gait.phases()
    before = state
    for _ in range(cycles):
        before = state
        for duration, valve in zip(durations, valves.T):
            state = rival(state, valve, duration)
    return last_cycle(before[:3], state[:3])

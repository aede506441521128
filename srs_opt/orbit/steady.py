"""A gait's steady state in one call: orbit, motion, envelope, stability, friction work."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from srs_opt.errors import NoAnswerError
from srs_opt.gait import Gait, check_gait
from srs_opt.model.state import HEADING, POSE
from srs_opt.orbit.actuators import actuator_multiplier
from srs_opt.orbit.body import body_over_cycle, integrator
from srs_opt.orbit.settings import CHAIN
from srs_opt.orbit.solve import PeriodicSolution, search_orbit
from srs_opt.parallel import executor
from srs_opt.parallel.sweep import sweep
from srs_opt.result import Result
from srs_opt.robot import Robot
from srs_opt.simulate.batched import Search, run_batched, run_one
from srs_opt.simulate.cycle_motion import CycleMotion, cycle_motion
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.rosenbrock import WORK

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Orbit(Result):
    """The relative periodic orbit of a gait.

    Attributes
    ----------
    robot : Robot
    model : str
    gait : Gait
    motion : CycleMotion
        Speed, turn rate, radius, envelope.
    work_j : float
        Friction work per cycle.
    dynamic : array (d,)
        Dynamic states at time 0, a start for neighbouring gaits: body velocity (u_x, u_y, yaw momentum), in
        the compliant model bends (1/m) and their rates as well.
    multipliers : complex array (d,)
        Floquet multipliers of the dynamic states (pose removed), largest first.
    shape_multiplier : float
        Largest modulus of the actuators' Floquet multipliers; exp(-period / max tau) where they are linear.
    time_s, pose, kappa : arrays (n,), (n, 3), (n, N-1)
        One cycle from time 0 to the period, starting at pose 0.
    solution : PeriodicSolution
    """

    robot: Robot
    model: str
    gait: Gait
    motion: CycleMotion
    work_j: float
    dynamic: np.ndarray
    multipliers: np.ndarray
    shape_multiplier: float
    time_s: np.ndarray
    pose: np.ndarray
    kappa: np.ndarray
    solution: PeriodicSolution

    @property
    def velocity(self) -> np.ndarray:
        """Body velocity (u_x, u_y, yaw momentum) at time 0, (3,)."""
        return self.dynamic[:3]

    @property
    def speed_m_s(self) -> float:
        """Mean speed along the path; negative backwards."""
        return self.motion.speed_m_s

    @property
    def turn_rate_rad_s(self) -> float:
        """Mean turn rate, + left."""
        return self.motion.turn_rate_rad_s

    @property
    def radius_m(self) -> float | None:
        """Radius of the mean path, + left; None when straight."""
        return self.motion.radius_m

    @property
    def envelope_m(self) -> tuple[float, float]:
        """Reach (right, left) of the body about the mean path, m."""
        return self.motion.envelope_m

    @property
    def largest_multiplier(self) -> float:
        """Largest modulus of all Floquet multipliers (shape and body velocity); below 1: stable."""
        return max(float(abs(self.multipliers[0])), self.shape_multiplier)

    def to_dict(self) -> dict[str, Any]:
        """Return the gait and its steady motion."""
        right, left = self.envelope_m
        return {
            "robot": self.robot.name,
            "model": self.model,
            "gait": self.gait.record(),
            "speed_m_s": self.speed_m_s,
            "turn_rate_rad_s": self.turn_rate_rad_s,
            "radius_m": self.radius_m,
            "envelope_m": {"right": right, "left": left},
            "work_j": self.work_j,
            "largest_multiplier": self.largest_multiplier,
        }

    def in_words(self) -> str:
        """Return the steady motion in one line."""
        way = "straight" if self.radius_m is None else f"radius {self.radius_m:+.3f} m"
        gait = self.gait
        return (
            f"{self.speed_m_s:.4f} m/s, {way}, at {gait.frequency_hz:.3f} Hz and {gait.pressure_kpa:.2f} kPa"
        )

    def figure(self) -> Figure:
        """Return the gait sheet: body, valves, curvatures, speeds, swept band, work over a cycle."""
        from srs_opt.orbit.figures import gait_figure

        return gait_figure(self)


def steady_gait(
    robot: Robot,
    gait: Gait,
    model: str | None = None,
    *,
    tolerance: float | None = None,
    guess: np.ndarray | None = None,
) -> Orbit:
    """Return the steady state of `gait`.

    Parameters
    ----------
    robot, gait, model
        The gait must drive every segment of the robot.
    tolerance : float, optional
        Local error of the integration, m/s per step; by default that of `INTEGRATION`.
    guess : array (d,), optional
        Dynamic states at time 0 of a neighbouring gait's orbit. Without it the orbit of a compliant model is
        the one that is reached from rest.

    Raises
    ------
    InputError
        If gait and robot do not belong together.
    NoAnswerError
        If no steady state is found.
    """
    run = integrator(robot, model)
    return run_one(_search(run, gait, tolerance, guess))


def steady_gaits(
    robot: Robot,
    gaits: Sequence[Gait],
    model: str | None = None,
    *,
    tolerance: float | None = None,
    jobs: int = 1,
) -> list[Orbit | NoAnswerError]:
    """Return the steady states of many gaits, several at a time in each call of the compiled code.

    Gaits that follow each other in the list should be alike: every hundred or so are cut into `CHAIN.chains`
    parts, and in each part a gait's orbit is the guess for the next (not in the compliant model: every gait
    starts from rest). `jobs` processes share the work; the
    results are the same. For a gait without a steady state the error says why.

    Raises
    ------
    InputError
        If a gait and the robot do not belong together.
    """
    for gait in gaits:
        check_gait(robot, gait)
    work = partial(_side_by_side, robot, model, tolerance)
    with executor(jobs) as where:
        return list(sweep(work, gaits, chunk=CHAIN.chains * CHAIN.length, where=where))


def _side_by_side(
    robot: Robot, model: str | None, tolerance: float | None, gaits: Sequence[Gait]
) -> list[Orbit | NoAnswerError]:
    run = integrator(robot, model)
    parts = np.array_split(np.arange(len(gaits)), min(CHAIN.chains, max(len(gaits), 1)))
    chains = [_chain(run, [gaits[i] for i in part], tolerance) for part in parts]
    found: list[Orbit | NoAnswerError] = []
    for chain in run_batched(chains):
        if isinstance(chain, NoAnswerError):  # a chain answers for each of its gaits
            raise chain
        found += chain
    return found


def _chain(
    run: Integrator, gaits: Sequence[Gait], tolerance: float | None
) -> Search[list[Orbit | NoAnswerError]]:
    found: list[Orbit | NoAnswerError] = []
    guess = None
    for gait in gaits:
        try:
            orbit = yield from _search(run, gait, tolerance, guess)
        except NoAnswerError as error:
            found.append(error)
            guess = None
        else:
            found.append(orbit)
            guess = None if run.structure.compliant else orbit.dynamic
    return found


def _search(run: Integrator, gait: Gait, tolerance: float | None, guess: np.ndarray | None) -> Search[Orbit]:
    check_gait(run.robot, gait)
    return orbit_of(run, gait, (yield from search_orbit(run, gait, tolerance, guess)))


def orbit_of(run: Integrator, gait: Gait, solution: PeriodicSolution) -> Orbit:
    """Return the steady gait that a periodic solution is."""
    robot = run.robot
    p = run.pack(gait.pressure_kpa, gait.frequency_hz)
    time_s = np.concatenate([[0.0], np.cumsum(solution.mesh.h_s)])
    states = np.concatenate([solution.start[:, None], solution.states], axis=1)
    pose, kappa = states[POSE].T, states[run.layout.kappa].T
    # the delay of the valves shifts the whole cycle in time and changes nothing else
    motion = cycle_motion(*body_over_cycle(run, time_s, pose, kappa), robot.body_width_m)
    multipliers = np.linalg.eigvals(solution.monodromy)
    return Orbit(
        robot=robot,
        model=run.structure.model,
        gait=gait,
        motion=motion,
        work_j=float(solution.states[WORK, -1]),
        dynamic=solution.start[run.layout.dynamic],
        multipliers=multipliers[np.argsort(-abs(multipliers))],
        shape_multiplier=actuator_multiplier(run, gait, solution.start[run.layout.actuator], p),
        time_s=time_s,
        pose=pose,
        kappa=kappa,
        solution=solution,
    )


def travelling(robot: Robot, gait: Gait, model: str | None = None) -> np.ndarray:
    """Return the state (nx,) of a steady gait at its time 0, at the origin, travelling along x."""
    orbit = steady_gait(robot, gait, model)
    state: np.ndarray = orbit.solution.start.copy()
    dx, dy, turn = orbit.motion.displacement
    # a cycle's chord leads by half the cycle's turn over the course at its start
    course = math.atan2(dy, dx) - turn / 2 + (math.pi if orbit.speed_m_s < 0 else 0.0)
    state[POSE] = 0.0, 0.0, state[HEADING] - course
    state[WORK] = 0.0
    return state

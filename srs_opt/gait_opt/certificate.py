"""The certificate: the finished gait simulated switch-exactly, with nothing of the optimizer's in it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.model.effects import all_effects
from srs_opt.orbit.attractors import other_orbits
from srs_opt.orbit.steady import Orbit, body_over_cycle, integrator, steady_gait
from srs_opt.robot import Robot
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.rosenbrock import VELOCITY
from srs_opt.simulate.run import motion_of_cycle
from srs_opt.simulate.timeline import Timeline

CYCLES = 50
SPEED_ERROR = 0.005  # collocation against simulation
SPEED_FLOOR_M_S = 5e-4  # of that difference, for gaits that hardly move
GAP = 1e-3  # change of the motion over CYCLES cycles, over its size
TURN_ERROR = 0.02
STANDING_START = 0.01  # speed of the last of CYCLES cycles from rest against the steady one
LIMIT_EXCESS = 0.01
_STRAIGHT_RAD_S = 0.02


@dataclass(frozen=True)
class Certificate:
    """What simulation says about a finished gait.

    Attributes
    ----------
    speed_m_s : float
    relative_error : float
        Speed that the optimizer claimed against the simulated one.
    periodicity_gap : float
        Change of velocity and shape over 50 simulated cycles, over their size.
    largest_floquet_multiplier : float
        Of shape and body velocity, pose removed.
    standing_start_m_s : float
        Mean speed over the last of 50 cycles from rest.
    other_orbits_m_s : tuple of float
        Speeds of other stable orbits of the same gait, found from rolling starts (soft bodies can have some).
    dwell_ok : bool
    switches_per_s : float
    failures : tuple of str
        What is not as it should be, in words; empty when passed.
    """

    speed_m_s: float
    relative_error: float
    periodicity_gap: float
    largest_floquet_multiplier: float
    standing_start_m_s: float
    other_orbits_m_s: tuple[float, ...]
    dwell_ok: bool
    switches_per_s: float
    failures: tuple[str, ...] = field(default=())

    @property
    def passed(self) -> bool:
        """Whether nothing failed."""
        return not self.failures

    def record(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {
            "speed_m_s": self.speed_m_s,
            "relative_error": self.relative_error,
            "periodicity_gap": self.periodicity_gap,
            "largest_floquet_multiplier": self.largest_floquet_multiplier,
            "standing_start_m_s": self.standing_start_m_s,
            "other_orbits_m_s": list(self.other_orbits_m_s),
            "dwell_ok": self.dwell_ok,
            "switches_per_s": self.switches_per_s,
            "passed": self.passed,
            "failures": list(self.failures),
        }


def certify(problem: CycleProblem, gait: Gait, claimed_m_s: float) -> tuple[Certificate, tuple[Orbit, ...]]:
    """Return the certificate of a gait that stands on the controller's ticks, and its orbits per robot."""
    orbits = tuple(steady_gait(r, gait, problem.model) for r in problem.robots)
    orbit, robot = orbits[0], problem.robots[0]
    speed = orbit.speed_m_s
    error = abs(claimed_m_s - speed) / max(abs(speed), 1e-9)
    gap = periodicity_gap(robot, gait, problem.model, orbit)
    largest = max(o.largest_multiplier for o in orbits)
    standing = standing_start(robot, gait, problem.model)
    others = other_orbits(robot, orbit, problem.model)
    dwell = gait.shortest_dwell_s()
    dwell_ok = dwell >= problem.limits.min_dwell_s - 1e-9
    failures = []
    if abs(claimed_m_s - speed) > max(SPEED_ERROR * abs(speed), SPEED_FLOOR_M_S):
        failures.append(f"simulated speed {speed:.4f} m/s, the optimizer's {claimed_m_s:.4f} m/s")
    if gap > GAP:
        failures.append(f"after {CYCLES} cycles the motion has changed by {gap:.2g} of its size")
    if abs(standing - speed) > max(STANDING_START * abs(speed), SPEED_FLOOR_M_S):
        failures.append(
            f"{CYCLES} cycles from rest end at {standing:.4f} m/s, the steady gait has {speed:.4f}"
        )
    if largest >= 1:
        failures.append(f"the gait is unstable: largest Floquet multiplier {largest:.3f}")
    if not dwell_ok:
        failures.append(f"a valve holds for {dwell:.4f} s, shorter than {problem.limits.min_dwell_s:.4f} s")
    failures += _limits_broken(problem.limits, gait, orbits)
    failures += _wishes_missed(problem.goal, orbit)
    for r, o in zip(problem.robots, orbits):
        if (room := self_clearance_m(r, o, problem.model)) < 0:
            failures.append(f"the body of robot '{r.name}' overlaps itself by {-1e3 * room:.1f} mm")
    certificate = Certificate(
        speed,
        error,
        gap,
        largest,
        standing,
        tuple(o.speed_m_s for o in others),
        dwell_ok,
        gait.switches_per_s,
        tuple(failures),
    )
    return certificate, orbits


def standing_start(robot: Robot, gait: Gait, model: str, cycles: int = CYCLES) -> float:
    """Return the mean speed (m/s) over the last of `cycles` cycles from rest."""
    run = _undelayed(robot, model)
    path = run.run(Timeline.of_gait(gait, cycles * gait.period_s), run.rest())
    return motion_of_cycle(run, path, gait, cycles - 1).speed_m_s


def _undelayed(robot: Robot, model: str) -> Integrator:
    """Return the robot's integrator without delays: they shift the whole cycle in time, nothing else."""
    own = tuple(e for e in robot.effects if all_effects()[e["name"]].delay is None)
    return integrator(replace(robot, valve_delay_s=0.0, effects=own), model)


def periodicity_gap(robot: Robot, gait: Gait, model: str, orbit: Orbit, cycles: int = CYCLES) -> float:
    """Return by how much velocity and shape change over simulated cycles, relative to their size."""
    start = orbit.solution.start
    run = _undelayed(robot, model)
    x = run.run(Timeline.of_gait(gait, cycles * gait.period_s), start).final
    change = np.abs(x - start)
    speeds = orbit.solution.states[VELOCITY]
    momentum = np.abs(speeds[2]).max() or 1.0
    size = max(np.abs(speeds[:2]).max(), 1e-6)
    body = max(change[3], change[4]) / size, change[5] / momentum
    shape = change[run.layout.kappa].max() / max(np.abs(orbit.kappa).max(), 1e-9)
    return float(max(*body, shape))


def _limits_broken(limits: Limits, gait: Gait, orbits: tuple[Orbit, ...]) -> list[str]:
    broken = []
    for name, value, (low, high), unit in (
        ("frequency", gait.frequency_hz, limits.frequency_hz, "Hz"),
        ("pressure", gait.pressure_kpa, limits.pressure_kpa, "kPa"),
    ):
        if not low * (1 - 2e-3) <= value <= high * (1 + 2e-3):
            broken.append(f"{name} {value:.3f} {unit} is outside {low:g} ... {high:g}")
    most = limits.max_curvature_1_m
    bend = max(float(np.abs(o.kappa).max()) for o in orbits)
    if most is not None and bend > most * (1 + LIMIT_EXCESS):
        broken.append(f"curvature reaches {bend:.2f} 1/m, limit {most:g}")
    return broken


def _wishes_missed(goal: Goal, orbit: Orbit) -> list[str]:
    missed = []
    turn = orbit.turn_rate_rad_s
    if goal.envelope_m is not None and sum(orbit.envelope_m) > goal.envelope_m * (1 + LIMIT_EXCESS):
        missed.append(f"the swept band is {sum(orbit.envelope_m):.4f} m wide, limit {goal.envelope_m:g} m")
    if goal.radius_m is not None:
        radius = orbit.radius_m
        if radius is None or abs(radius - goal.radius_m) > TURN_ERROR * abs(goal.radius_m):
            found = "none (straight)" if radius is None else f"{radius:.4f} m"
            missed.append(f"wanted radius {goal.radius_m:g} m, simulated {found}")
    elif goal.turn_rate_rad_s is not None:
        if abs(turn - goal.turn_rate_rad_s) > max(TURN_ERROR * abs(goal.turn_rate_rad_s), _STRAIGHT_RAD_S):
            missed.append(f"wanted turn rate {goal.turn_rate_rad_s:g} rad/s, simulated {turn:.3f}")
    elif not goal.tightest and abs(turn) > _STRAIGHT_RAD_S:
        missed.append(f"the gait should run straight but turns at {turn:.3f} rad/s")
    if (
        goal.speed_m_s
        and goal.objective != "speed"
        and orbit.speed_m_s < goal.speed_m_s * (1 - SPEED_ERROR * 2)
    ):
        missed.append(f"wanted speed {goal.speed_m_s:g} m/s, simulated {orbit.speed_m_s:.4f} m/s")
    return missed


def self_clearance_m(robot: Robot, orbit: Orbit, model: str | None = None) -> float:
    """Return the room between parts of the body that are not neighbours, over a cycle (negative: overlap)."""
    run = integrator(robot, model)
    _, _, x, y = body_over_cycle(run, orbit.time_s, orbit.pose, orbit.kappa)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x[:, 0]), np.diff(y[:, 0])))])
    apart = np.abs(along[:, None] - along[None]) > 1.6 * robot.body_width_m  # half a turn of its own width
    if not apart.any():
        return float("inf")
    i, j = np.nonzero(np.triu(apart))
    distance = np.hypot(x[i] - x[j], y[i] - y[j])
    return float(distance.min() - robot.body_width_m)

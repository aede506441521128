"""The certificate: the final gait simulated with exact switch times, independent of the optimizer."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from srs_opt.effects import known_effects
from srs_opt.gait import Gait
from srs_opt.gait_opt.collocation.problem import CycleProblem
from srs_opt.gait_opt.goal import Goal, Limits
from srs_opt.gait_opt.score import broken_constraints, evaluated, robot_scores
from srs_opt.gait_opt.settings import CERTIFICATE, GOAL, CertificateSettings
from srs_opt.geometry import distance_along
from srs_opt.model.state import FORWARD, SIDEWAYS, YAW_MOMENTUM
from srs_opt.orbit.attractors import other_orbits
from srs_opt.orbit.body import body_over_cycle, integrator
from srs_opt.orbit.steady import Orbit, steady_gait
from srs_opt.robot import Robot
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.rosenbrock import VELOCITY
from srs_opt.simulate.run import motion_of_cycle
from srs_opt.simulate.timeline import Timeline


@dataclass(frozen=True)
class RobotCertificate:
    """What simulation says about a finished gait on one robot.

    Attributes
    ----------
    name : str
    speed_m_s, turn_rate_rad_s : float
    radius_m : float or None
    band_m : float
        Total width of the swept band.
    claimed_m_s : float
        Speed that the optimizer claimed.
    periodicity_gap : float
        Change of velocity and shape over 50 simulated cycles, over their size.
    largest_floquet_multiplier : float
        Of shape and body velocity, pose removed.
    standing_start_m_s : float
        Mean speed over the last of 50 cycles from rest.
    other_orbits_m_s : tuple of float
        Speeds of other stable orbits of the same gait, found from rolling starts (soft bodies can have some).
    failures : tuple of str
        What is not as it should be, in words; empty when passed.
    """

    name: str
    speed_m_s: float
    turn_rate_rad_s: float
    radius_m: float | None
    band_m: float
    claimed_m_s: float
    periodicity_gap: float
    largest_floquet_multiplier: float
    standing_start_m_s: float
    other_orbits_m_s: tuple[float, ...]
    failures: tuple[str, ...]

    @property
    def relative_error(self) -> float:
        """Speed that the optimizer claimed against the simulated one."""
        return abs(self.claimed_m_s - self.speed_m_s) / max(abs(self.speed_m_s), 1e-9)

    def record(self) -> dict[str, Any]:
        """Return the JSON object."""
        return {
            "name": self.name,
            "speed_m_s": self.speed_m_s,
            "turn_rate_rad_s": self.turn_rate_rad_s,
            "radius_m": self.radius_m,
            "band_m": self.band_m,
            "relative_error": self.relative_error,
            "periodicity_gap": self.periodicity_gap,
            "largest_floquet_multiplier": self.largest_floquet_multiplier,
            "standing_start_m_s": self.standing_start_m_s,
            "other_orbits_m_s": list(self.other_orbits_m_s),
            "passed": not self.failures,
            "failures": list(self.failures),
        }


@dataclass(frozen=True)
class Certificate:
    """What simulation says about a finished gait on every robot that it is for.

    Attributes
    ----------
    robots : tuple of RobotCertificate
        The nominal one first.
    worst : int
        The robot that serves the goal worst: its targets missed most or, none missed, its merit lowest.
    dwell_ok : bool
    switches_per_s : float
    common : tuple of str
        What is wrong with the gait itself, whatever the robot.
    """

    robots: tuple[RobotCertificate, ...]
    worst: int
    dwell_ok: bool
    switches_per_s: float
    common: tuple[str, ...] = field(default=())

    @property
    def speed_m_s(self) -> float:
        """Simulated speed of the nominal robot."""
        return self.robots[0].speed_m_s

    @property
    def relative_error(self) -> float:
        """Largest error of the claimed speed over the robots."""
        return max(r.relative_error for r in self.robots)

    @property
    def worst_robot(self) -> RobotCertificate:
        """The robot that serves the goal worst."""
        return self.robots[self.worst]

    @property
    def failures(self) -> tuple[str, ...]:
        """What is not as it should be, in words, the robots named where there are several."""
        several = len(self.robots) > 1
        own = [f"robot '{r.name}': {text}" if several else text for r in self.robots for text in r.failures]
        return (*self.common, *own)

    @property
    def passed(self) -> bool:
        """Whether nothing failed."""
        return not self.failures

    def record(self) -> dict[str, Any]:
        """Return the JSON object: the largest of what should be small, over the robots."""
        return {
            "speed_m_s": self.speed_m_s,
            "relative_error": self.relative_error,
            "periodicity_gap": max(r.periodicity_gap for r in self.robots),
            "largest_floquet_multiplier": max(r.largest_floquet_multiplier for r in self.robots),
            "standing_start_m_s": self.robots[0].standing_start_m_s,
            "other_orbits_m_s": list(self.robots[0].other_orbits_m_s),
            "dwell_ok": self.dwell_ok,
            "switches_per_s": self.switches_per_s,
            "passed": self.passed,
            "failures": list(self.failures),
        }


def certify(
    problem: CycleProblem,
    gait: Gait,
    claimed_m_s: tuple[float, ...],
    settings: CertificateSettings = CERTIFICATE,
) -> tuple[Certificate, tuple[Orbit, ...]]:
    """Return the certificate of a gait that stands on the controller's ticks, and its orbits per robot.

    `claimed_m_s` are the speeds that the optimizer says the robots make. Every check is made on every robot.
    """
    orbits = tuple(steady_gait(r, gait, problem.model) for r in problem.robots)
    dwell = gait.shortest_dwell_s()
    # dwells are differences of times: a nanosecond is rounding
    dwell_ok = dwell >= problem.limits.min_dwell_s - 1e-9
    common = []
    if not dwell_ok:
        common.append(f"a valve holds for {dwell:.4f} s, shorter than {problem.limits.min_dwell_s:.4f} s")
    common += _ranges_left(problem.limits, gait)
    robots = tuple(_certified(problem, gait, r, o, claimed_m_s[r], settings) for r, o in enumerate(orbits))
    scores = robot_scores(problem, gait, orbits)
    # robots with failures first, then by score
    worst = min(range(len(robots)), key=lambda r: (not robots[r].failures, scores[r].total))
    return Certificate(robots, worst, dwell_ok, gait.switches_per_s, tuple(common)), orbits


def _certified(
    problem: CycleProblem,
    gait: Gait,
    index: int,
    orbit: Orbit,
    claimed_m_s: float,
    settings: CertificateSettings,
) -> RobotCertificate:
    robot = problem.robots[index]
    speed, largest = orbit.speed_m_s, orbit.largest_multiplier
    cycles, floor_m_s = settings.cycles, settings.speed_floor * robot.length_m
    gap = periodicity_gap(robot, gait, problem.model, orbit, cycles)
    standing = standing_start(robot, gait, problem.model, cycles)
    failures = []
    if abs(claimed_m_s - speed) > max(settings.speed_error * abs(speed), floor_m_s):
        failures.append(f"simulated speed {speed:.4f} m/s, the optimizer's {claimed_m_s:.4f} m/s")
    if gap > settings.gap:
        failures.append(f"after {cycles} cycles the motion has changed by {gap:.2g} of its size")
    if not reached_from_rest(robot, speed, standing, settings):
        failures.append(
            f"{cycles} cycles from rest end at {standing:.4f} m/s, the steady gait has {speed:.4f}"
        )
    if largest >= 1:
        failures.append(f"the gait is unstable: largest Floquet multiplier {largest:.3f}")
    failures += _curvature_exceeded(problem.limits, orbit, settings)
    failures += _targets_missed(problem.goal, orbit, settings)
    _, rows = evaluated(problem, problem.goal.aim, gait, index, orbit)
    failures += [
        f"constraint {name} is missed by {over:.4g}"
        for name, over in broken_constraints(problem, rows)
        if not over <= settings.constraint_excess
    ]
    if (room := self_clearance_m(robot, orbit, problem.model)) < 0:
        failures.append(f"the body overlaps itself by {-1e3 * room:.1f} mm")
    others = other_orbits(robot, orbit, problem.model)
    return RobotCertificate(
        robot.name, speed, orbit.turn_rate_rad_s, orbit.radius_m, sum(orbit.envelope_m), claimed_m_s, gap,
        largest, standing, tuple(o.speed_m_s for o in others), tuple(failures),
    )  # fmt: skip


def reached_from_rest(
    robot: Robot, steady_m_s: float, standing_m_s: float, settings: CertificateSettings = CERTIFICATE
) -> bool:
    """Whether the speed that a standing start comes to is that of the steady gait, near enough."""
    allowed_m_s = max(settings.standing_start * abs(steady_m_s), settings.speed_floor * robot.length_m)
    return abs(standing_m_s - steady_m_s) <= allowed_m_s


def standing_start(robot: Robot, gait: Gait, model: str, cycles: int | None = None) -> float:
    """Return the mean speed (m/s) over the last of `cycles` cycles from rest (None: the certificate's)."""
    cycles = CERTIFICATE.cycles if cycles is None else cycles
    run = _undelayed(robot, model)
    path = run.integrate(Timeline.of_gait(gait, cycles * gait.period_s), run.rest())
    return motion_of_cycle(run, path, gait, cycles - 1).speed_m_s


def _undelayed(robot: Robot, model: str) -> Integrator:
    """Return the robot's integrator without delays: they shift the whole cycle in time, nothing else."""
    own = tuple(e for e in robot.effects if known_effects()[e["name"]].delay is None)
    return integrator(replace(robot, valve_delay_s=0.0, effects=own), model)


def periodicity_gap(robot: Robot, gait: Gait, model: str, orbit: Orbit, cycles: int | None = None) -> float:
    """Return by how much velocity and shape change over simulated cycles, relative to their size."""
    cycles = CERTIFICATE.cycles if cycles is None else cycles
    start = orbit.solution.start
    run = _undelayed(robot, model)
    x = run.integrate(Timeline.of_gait(gait, cycles * gait.period_s), start).final
    change = np.abs(x - start)
    speeds = orbit.solution.states[VELOCITY]
    momentum = np.abs(speeds[2]).max() or 1.0
    size = max(np.abs(speeds[:2]).max(), 1e-6)
    body = max(change[FORWARD], change[SIDEWAYS]) / size, change[YAW_MOMENTUM] / momentum
    shape = change[run.layout.kappa].max() / max(np.abs(orbit.kappa).max(), 1e-9)
    return float(max(*body, shape))


def _ranges_left(limits: Limits, gait: Gait) -> list[str]:
    return [
        f"{name} {value:.3f} {unit} is outside {low:g} ... {high:g}"
        for name, value, (low, high), unit in (
            ("frequency", gait.frequency_hz, limits.frequency_hz, "Hz"),
            ("pressure", gait.pressure_kpa, limits.pressure_kpa, "kPa"),
        )
        if not low * (1 - GOAL.frequency_excess) <= value <= high * (1 + GOAL.frequency_excess)
    ]


def _curvature_exceeded(limits: Limits, orbit: Orbit, settings: CertificateSettings) -> list[str]:
    most, largest = limits.max_curvature_1_m, float(np.abs(orbit.kappa).max())
    if most is None or largest <= most * (1 + settings.limit_excess):
        return []
    return [f"curvature reaches {largest:.2f} 1/m, limit {most:g}"]


def _targets_missed(goal: Goal, orbit: Orbit, settings: CertificateSettings) -> list[str]:
    missed = []
    floor = goal.floor_m_s
    if goal.envelope_m is not None and sum(orbit.envelope_m) > goal.envelope_m * (1 + settings.limit_excess):
        missed.append(f"the swept band is {sum(orbit.envelope_m):.4f} m wide, limit {goal.envelope_m:g} m")
    missed += _turn_missed(goal, orbit)
    if floor is not None and orbit.speed_m_s < floor * (1 - settings.speed_error * 2):
        wanted = "wanted" if goal.speed_m_s else "least"
        missed.append(f"{wanted} speed {floor:g} m/s, simulated {orbit.speed_m_s:.4f} m/s")
    return missed


def _turn_missed(goal: Goal, orbit: Orbit) -> list[str]:
    turn, radius = orbit.turn_rate_rad_s, orbit.radius_m
    if goal.radius_m is not None:
        if radius is not None and abs(radius - goal.radius_m) <= GOAL.turn_error * abs(goal.radius_m):
            return []
        found = "none (straight)" if radius is None else f"{radius:.4f} m"
        return [f"wanted radius {goal.radius_m:g} m, simulated {found}"]
    if goal.turn_rate_rad_s is not None:
        if abs(turn - goal.turn_rate_rad_s) <= max(
            GOAL.turn_error * abs(goal.turn_rate_rad_s), GOAL.straight_rad_s
        ):
            return []
        return [f"wanted turn rate {goal.turn_rate_rad_s:g} rad/s, simulated {turn:.3f}"]
    if goal.turn == "side" and goal.sense * turn < GOAL.least_turn_rad_s * (1 - GOAL.turn_error):
        return [f"the gait should turn {goal.side} but turns at {turn:+.3f} rad/s (+ is left)"]
    if goal.turn == "straight" and abs(turn) > GOAL.straight_rad_s:
        return [f"the gait should run straight but turns at {turn:.3f} rad/s"]
    return []


def self_clearance_m(robot: Robot, orbit: Orbit, model: str | None = None) -> float:
    """Return the room between parts of the body that are not neighbours, over a cycle (negative: overlap)."""
    run = integrator(robot, model)
    _, _, x, y = body_over_cycle(run, orbit.time_s, orbit.pose, orbit.kappa)
    along = distance_along(np.stack([x[:, 0], y[:, 0]], axis=1))
    apart = np.abs(along[:, None] - along[None]) > CERTIFICATE.apart_widths * robot.body_width_m
    if not apart.any():
        return float("inf")
    # every pair once
    i, j = np.nonzero(np.triu(apart))
    distance = np.hypot(x[i] - x[j], y[i] - y[j])
    return float(distance.min() - robot.body_width_m)

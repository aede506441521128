"""Bending stiffness from step tests of the whole snake, lifted and on the ground (paper, Fig. 6).

A lifted segment follows its no-load curvature. On the ground the wheels of both sides must be dragged
sideways, and the bending moment of their friction costs an interior segment M/EI of its bend. So the lifted
test of a segment tells what drives the test on the ground, and the simulated step of the whole snake on the
ground has one unknown, the flexibility 1/EI; amplitudes, time constants and friction across the wheels are
nuisance parameters with the deviations that they are known to.

A ground that takes a share of every bend and slows every step alike, whatever the pressure, is something
else: curves that lifted ones on another scale explain better get no stiffness (`BendingFit.scaled`).

Friction is dry here: smoothed with the robot's own speed the loss would relax within a second or two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.effects import known_effects
from srs_opt.errors import NoAnswerError
from srs_opt.measurement.actuator_bench import ActuatorBench, combine_steps
from srs_opt.measurement.fit_settings import BENDING
from srs_opt.measurement.records import Array, StepTest
from srs_opt.measurement.steps import StepFit, fit_steps
from srs_opt.model.actuator_law import step_response
from srs_opt.robot import Robot
from srs_opt.simulate.batched import run_batched
from srs_opt.simulate.integrate import Integrator
from srs_opt.simulate.timeline import Timeline

SINGLE_STEP_HZ = 1e-9  # a single step has no frequency for the supply to droop with


@dataclass(frozen=True)
class BendingFit:
    """Bending stiffness of the segments from pairs of step tests.

    Attributes
    ----------
    flexibility_1_n_m2, flexibility_sd_1_n_m2 : float
        1/EI with its standard deviation, widened where the residuals are larger than the readings' noise.
    stiffness_n_m2, relative_sd : float or None
        EI and its deviation over value; None where the flexibility cannot be told from zero.
    stiffer_than_n_m2 : float
        EI exceeds this (97.5 %).
    misfit : float
        Squared residuals over their expectation; far above 1 the tests on the ground are not what friction
        makes of the lifted ones.
    pairs : int
        Tests on the ground that were used.
    scaled : (bend, time) or None
        Where the tests on the ground are the lifted ones on another scale, rather than what a bending moment
        leaves of them: these scales. There is no stiffness then.
    """

    flexibility_1_n_m2: float
    flexibility_sd_1_n_m2: float
    stiffness_n_m2: float | None
    relative_sd: float | None
    stiffer_than_n_m2: float
    misfit: float
    pairs: int
    scaled: tuple[float, float] | None = None


@dataclass(frozen=True)
class _Pair:
    """A test on the ground and what its lifted twin says."""

    ground: StepTest
    amplitude_1_m: float
    amplitude_sd_1_m: float
    noise_1_m: float


def fit_bending(tests: Sequence[StepTest], robot: Robot) -> BendingFit | None:
    """Fit the bending stiffness to every pair of a segment's tests, lifted and on the ground.

    Parameters
    ----------
    tests : sequence of StepTest
        Steps of one segment each, from rest, the other segments vented, the whole snake assembled. Interior
        segments carry the information; end segments are used only where there are no others.
    robot : Robot
        Masses, geometry, friction across the wheels (with its ``relative_sd``) and relaxation time.

    Returns
    -------
    BendingFit or None
        None without a pair.

    Raises
    ------
    NoAnswerError
        If the fit does not settle.
    """
    fits = fit_steps(tests)
    pairs = _pairs(tests, fits, robot)
    if not pairs:
        return None
    constants = combine_steps([f for f in fits if f.condition == "lifted"]).constants("lifted")
    mean = (constants.tau1_s + constants.tau2_s) / 2
    spread = (constants.tau1_s - constants.tau2_s) / (2 * mean)
    mean_sd = float(np.hypot(constants.tau1_sd_s, constants.tau2_sd_s)) / 2
    known = np.array([mean, spread, 1.0, *(p.amplitude_1_m for p in pairs)])
    friction_sd = robot.relative_sd.get("friction_normal", 0.0)
    sds = np.array([mean_sd, mean_sd / mean, friction_sd, *(p.amplitude_sd_1_m for p in pairs)])
    # a deviation of zero would divide by zero in the prior's rows
    sds = np.maximum(sds, 1e-6 * np.maximum(np.abs(known), 1e-3))
    return _fit(_Problem(robot, pairs, known, sds))


def _pairs(tests: Sequence[StepTest], fits: Sequence[StepFit], robot: Robot) -> list[_Pair]:
    lifted: dict[tuple[int, float, bool], list[StepFit]] = {}
    for fit in fits:
        if fit.condition == "lifted" and fit.segment is not None:
            # left and right apart: constraint layers are not even
            lifted.setdefault((fit.segment, fit.pressure_kpa, fit.c0_1_m > 0), []).append(fit)
    pairs = []
    for test, fit in zip(tests, fits):
        twins = lifted.get((fit.segment or 0, fit.pressure_kpa, fit.c0_1_m > 0))
        if fit.condition != "ground" or not twins:
            continue
        amplitude = float(np.mean([abs(t.c0_1_m) for t in twins]))
        sd = float(np.sqrt(np.mean([t.c0_sd_1_m**2 for t in twins]) / len(twins)))
        # readings without noise would weigh without bound
        noise = max(float(np.mean([t.residual_sd_1_m for t in twins])), 1e-4 * amplitude)
        pairs.append(_Pair(test, amplitude, sd, noise))
    interior = [p for p in pairs if p.ground.segment not in (1, robot.segments)]
    return interior or pairs


class _Problem:
    """Residuals of the tests on the ground and of what is known before, with their derivatives."""

    def __init__(self, robot: Robot, pairs: list[_Pair], known: Array, sds: Array) -> None:
        delays = [e for e in robot.effects if known_effects()[e["name"]].delay is not None]
        self.robot = robot.with_values(
            friction_speed_m_s=BENDING.friction_speed_m_s,
            valve_delay_s=0.0,
            gap_stiffness_n_m2=None,
            effects=[dict(e) for e in robot.effects if e not in delays],
        )
        self.pairs, self.known, self.sds = pairs, known, sds

    def residuals(self, flexibility: float, nuisance: Array) -> Array:
        """Return the residuals in standard deviations."""
        curves = self._curves([(k, flexibility, nuisance) for k in range(len(self.pairs))])
        return np.concatenate([*map(self._residual, self.pairs, curves), (nuisance - self.known) / self.sds])

    def jacobian(self, flexibility: float, nuisance: Array) -> Array:
        """Return their derivatives by the flexibility and the nuisance parameters (differences)."""
        count = len(self.pairs)
        here = np.concatenate([[flexibility], nuisance])
        # large enough for the integration's error, which is 1e-6 of the bend
        steps = np.array([max(2e-3 * flexibility, 0.5), *(1e-3 * np.maximum(np.abs(nuisance), 0.05))])
        ends = (
            here + steps,
            np.maximum(here - steps, [BENDING.least_1_n_m2, *np.full(nuisance.size, -np.inf)]),
        )
        wanted, places = [], []
        for k in range(count):
            # a test depends on what all share and on its own amplitude, on no other's
            for i in (0, 1, 2, 3, 4 + k):
                for end in ends:
                    moved = here.copy()
                    moved[i] = end[i]
                    wanted.append((k, float(moved[0]), moved[1:]))
                places.append((k, i))
        curves = self._curves(wanted)
        sizes = [p.ground.time_s.size for p in self.pairs]
        firsts = np.concatenate([[0], np.cumsum(sizes)])
        matrix = np.zeros((firsts[-1] + nuisance.size, 1 + nuisance.size))
        for (k, i), up, down in zip(places, curves[::2], curves[1::2]):
            rows = slice(firsts[k], firsts[k + 1])
            matrix[rows, i] = (up - down) / (ends[0][i] - ends[1][i]) / self.pairs[k].noise_1_m
        matrix[firsts[-1] :, 1:] = np.diag(1 / self.sds)
        return matrix

    def _residual(self, pair: _Pair, curve: Array) -> Array:
        return np.asarray((curve - np.abs(pair.ground.curvature_1_m)) / pair.noise_1_m)

    def _curves(self, wanted: list[tuple[int, float, Array]]) -> list[Array]:
        """Return the simulated curvature of the stepped segment at the readings' times."""
        searches = []
        for k, flexibility, (mean, spread, friction, *amplitudes) in wanted:
            test = self.pairs[k].ground
            robot = self.robot.with_values(
                bending_stiffness_n_m2=1 / flexibility,
                curvature_per_pressure_1_m_kpa=amplitudes[k] / test.pressure_kpa,
                tau1_s=mean * (1 + abs(spread)),
                tau2_s=mean * max(1 - abs(spread), 1e-3),
                friction_normal=self.robot.friction_normal * friction,
            )
            run = Integrator(robot)
            valve = np.zeros((robot.segments, 1))
            # one segment pressed to the left, the others vented; steps to the right are mirrored
            valve[(test.segment or 1) - 1] = 1.0
            end = np.array([max(float(test.time_s[-1]), 0.05)])
            timeline = Timeline.constant(end, valve, test.pressure_kpa, SINGLE_STEP_HZ)
            searches.append(run.travel(timeline, run.rest(), BENDING.tolerance_m_s))
        curves = []
        for (k, _, _), path in zip(wanted, run_batched(searches)):
            if isinstance(path, NoAnswerError):
                raise path
            test = self.pairs[k].ground
            _, kappa = path.at(np.clip(test.time_s, 0.0, path.time_s[-1]))
            curves.append(kappa[:, (test.segment or 1) - 1])
        return curves


def _fit(problem: _Problem) -> BendingFit:
    """Gauss-Newton with step halving, from the best of several stiffnesses."""
    nuisance = problem.known.copy()
    costs = [float(np.sum(problem.residuals(f, nuisance) ** 2)) for f in BENDING.starts_1_n_m2]
    flexibility, cost = BENDING.starts_1_n_m2[int(np.argmin(costs))], min(costs)
    residual = problem.residuals(flexibility, nuisance)
    for _ in range(BENDING.iterations):
        jacobian = problem.jacobian(flexibility, nuisance)
        step = -np.linalg.lstsq(jacobian, residual, rcond=None)[0]
        for factor in (1.0, 0.5, 0.25, 0.1):
            trial = max(flexibility + factor * float(step[0]), BENDING.least_1_n_m2)
            there = nuisance + factor * step[1:]
            found = problem.residuals(trial, there)
            if np.sum(found**2) <= cost * (1 + 1e-9):
                break
        else:
            break
        moved = abs(trial - flexibility)
        flexibility, nuisance, residual, cost = trial, there, found, float(np.sum(found**2))
        if moved < BENDING.settled_share * max(flexibility, 1.0):
            break
    jacobian = problem.jacobian(flexibility, nuisance)
    readings = residual.size - nuisance.size
    misfit = cost / max(readings - 1, 1)
    # widened where the residuals are larger than the noise, never narrowed
    sd = float(np.sqrt(np.linalg.inv(jacobian.T @ jacobian)[0, 0] * max(misfit, 1.0)))
    alike, scales = _scaled(problem)
    scaled = scales if alike < cost - BENDING.scaled_gain else None
    detected = flexibility > BENDING.detected_sd * sd and scaled is None
    return BendingFit(
        flexibility_1_n_m2=flexibility,
        flexibility_sd_1_n_m2=sd,
        stiffness_n_m2=1 / flexibility if detected else None,
        relative_sd=sd / flexibility if detected else None,
        stiffer_than_n_m2=1 / (flexibility + 1.96 * sd),
        misfit=misfit,
        pairs=len(problem.pairs),
        scaled=scaled,
    )


def _scaled(problem: _Problem) -> tuple[float, tuple[float, float]]:
    """Return squared residuals of the lifted curves on other scales of bend and time, and these scales."""
    from scipy.optimize import least_squares

    mean, spread = problem.known[:2]

    def residuals(x: Array) -> Array:
        scales = np.maximum(np.abs(x[:2]), 1e-3)
        moved = x[2:] * problem.sds[3:]
        amplitudes = problem.known[3:] + moved
        curves = [
            scales[0] * a * step_response(p.ground.time_s / scales[1], mean, spread**2)
            for a, p in zip(amplitudes, problem.pairs)
        ]
        misses = [(c - np.abs(p.ground.curvature_1_m)) / p.noise_1_m for c, p in zip(curves, problem.pairs)]
        return np.concatenate([*misses, x[2:]])

    found = least_squares(residuals, [1.0, 1.0, *np.zeros(len(problem.pairs))])
    return 2 * float(found.cost), (float(found.x[0]), float(found.x[1]))


def bench_robot(robot: Robot, actuator: ActuatorBench, bending: BendingFit) -> Robot:
    """Return the robot with no-load curvature, time constants and stiffness from step tests.

    The lifted tests give the no-load values (those on the ground, where these are `BendingFit.scaled`);
    `relative_sd` says how well they are known, `sources` that they
    come from the bench.
    """
    condition = "lifted" if bending.scaled is None else "ground"
    slope, constants = actuator.slope(condition), actuator.constants(condition)
    values = {
        "curvature_per_pressure_1_m_kpa": (slope.value, slope.sd),
        "tau1_s": (constants.tau1_s, constants.tau1_sd_s),
        "tau2_s": (constants.tau2_s, constants.tau2_sd_s),
    }
    if bending.stiffness_n_m2 is not None and bending.relative_sd is not None:
        values["bending_stiffness_n_m2"] = (
            bending.stiffness_n_m2,
            bending.stiffness_n_m2 * bending.relative_sd,
        )
        robot = robot.with_values(gap_stiffness_n_m2=None)  # the measured one is that of chamber and gap
    return robot.with_values(
        **{name: value for name, (value, _) in values.items()},
        relative_sd={**robot.relative_sd, **{name: sd / value for name, (value, sd) in values.items()}},
        sources={**robot.sources, **dict.fromkeys(values, "bench")},
    )

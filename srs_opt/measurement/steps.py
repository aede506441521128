"""Actuator from step tests (paper, (14) and Fig. 6): C0, tau_1, tau_2 with covariance.

Fitted in C0, the mean time constant s = (tau_1 + tau_2)/2 and q = ((tau_1 - tau_2)/(tau_1 + tau_2))^2. The
response is analytic in q through q = 0, so that tau_1 = tau_2 is an ordinary point (in tau_1 and tau_2 it is
a fold, where the covariance of any least-squares fit breaks down).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.errors import InputError, NoAnswerError
from srs_opt.measurement.fit_settings import STEP_TEST
from srs_opt.measurement.records import Array, StepTest
from srs_opt.model.actuator_law import step_response


@dataclass(frozen=True, eq=False)
class StepFit:
    """Equation (14) fitted to one step.

    Attributes
    ----------
    test, segment, condition, pressure_kpa
        As in the test.
    c0_1_m, c0_sd_1_m : float
        Final curvature (signed) and its standard deviation.
    tau1_s, tau2_s : float
        Time constants, tau1 >= tau2.
    tau1_sd_s, tau2_sd_s : float
        Their standard deviations (of the folded distribution, finite at tau1 = tau2).
    tau1_interval_s, tau2_interval_s : (float, float)
        Their 90 % intervals.
    delay_s, delay_sd_s : float
        Dead time before the response; 0 unless fitted.
    equal : bool
        The data cannot tell tau1 from tau2 (95 %).
    symmetric : (float, float)
        (s, q) of the free fit, q of any sign: what to average over tests.
    covariance : ndarray, shape (3, 3)
        Of (C0, s, q).
    residual_sd_1_m : float
    autocorrelation : float
        Of neighbouring residuals; far from 0 the shape of (14) does not fit.
    samples : int
    """

    test: str
    segment: int | None
    condition: str
    pressure_kpa: float
    c0_1_m: float
    c0_sd_1_m: float
    tau1_s: float
    tau2_s: float
    tau1_sd_s: float
    tau2_sd_s: float
    tau1_interval_s: tuple[float, float]
    tau2_interval_s: tuple[float, float]
    delay_s: float
    delay_sd_s: float
    equal: bool
    symmetric: tuple[float, float]
    covariance: Array
    residual_sd_1_m: float
    autocorrelation: float
    samples: int


def fit_step(test: StepTest, *, fit_delay: bool = False) -> StepFit:
    """Fit (14) to one step that starts at time 0 from rest.

    Raises
    ------
    InputError
        If there are too few samples.
    NoAnswerError
        If the fit does not converge.
    """
    from scipy.optimize import least_squares

    time, curvature = np.asarray(test.time_s), np.asarray(test.curvature_1_m)
    unknowns = 4 if fit_delay else 3
    if len(time) <= unknowns:
        raise InputError(f"step '{test.test}' has {len(time)} samples, expected more than {unknowns}")
    # curvature in units of its end value: all unknowns are of order one
    final = float(np.median(curvature[-max(3, len(time) // 10) :])) or 1.0

    def model(p: Array) -> Array:
        return np.asarray(p[0] * final * step_response(time - (p[3] if fit_delay else 0.0), p[1], p[2]))

    lows, highs = [-np.inf, 1e-5, -2.0, -1.0][:unknowns], [np.inf, 1e3, STEP_TEST.largest_q, 1.0][:unknowns]
    fits = []
    # nearly equal and unlike time constants: the fit can stall on the wrong side
    for q in (0.05, 0.6):
        start = [1.0, _rise_time(time, curvature / final) / 2, q, 0.0][:unknowns]
        fits.append(least_squares(lambda p: model(p) - curvature, start, bounds=(lows, highs), x_scale="jac"))
    best = min(fits, key=lambda f: f.cost)
    if not best.success:
        raise NoAnswerError(f"step '{test.test}': (14) cannot be fitted: {best.message}")
    if best.x[2] < 0:  # two real time constants: the nearest are equal ones
        free = [i for i in range(unknowns) if i != 2]

        def equal(p: Array) -> Array:
            return model(np.insert(p, 2, 0.0)) - curvature

        bounds = ([lows[i] for i in free], [highs[i] for i in free])
        held = least_squares(equal, best.x[free], bounds=bounds, x_scale="jac")
        values = np.insert(held.x, 2, 0.0)
    else:
        values = best.x
    return _summary(test, best.x, values, model, curvature, final)


def _rise_time(time: Array, unit: Array) -> float:
    """Return when the response reaches about its half, a scale for the time constants."""
    above = np.flatnonzero(unit >= 0.55)
    span = float(time[-1] - time[0])
    return max(float(time[above[0]]) if len(above) else span / 3, span * 1e-3, 1e-4)


def _summary(
    test: StepTest,
    free: Array,
    values: Array,
    model: Callable[[Array], Array],
    curvature: Array,
    final: float,
) -> StepFit:
    """Errors are those of the free fit (q of any sign), values those of the fit with q >= 0."""
    residual = curvature - model(free)
    steps = np.array([1e-6, 1e-6 * free[1], 1e-6, 1e-7])[: len(free)]
    columns = [(model(free + d) - model(free - d)) for d in np.diag(steps)]
    jacobian = np.column_stack(columns) / (2 * steps)
    variance = float(residual @ residual) / (len(residual) - len(values))
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * variance
    scale = np.ones(len(values))
    scale[0] = final
    covariance = covariance * np.outer(scale, scale)
    one, two = time_constants(float(free[1]), float(free[2]), covariance[1:3, 1:3])
    lagged = float(residual[1:] @ residual[:-1]) / max(float(residual @ residual), 1e-300)
    root = float(np.sqrt(max(values[2], 0.0)))
    return StepFit(
        test=test.test,
        segment=test.segment,
        condition=test.condition,
        pressure_kpa=test.pressure_kpa,
        c0_1_m=float(values[0] * final),
        c0_sd_1_m=float(np.sqrt(covariance[0, 0])),
        tau1_s=float(values[1]) * (1 + root),
        tau2_s=float(values[1]) * (1 - root),
        tau1_sd_s=one.sd,
        tau2_sd_s=two.sd,
        tau1_interval_s=one.interval,
        tau2_interval_s=two.interval,
        delay_s=float(values[3]) if len(values) > 3 else 0.0,
        delay_sd_s=float(np.sqrt(covariance[3, 3])) if len(values) > 3 else 0.0,
        equal=bool(free[2] < 1.645 * np.sqrt(covariance[2, 2])),
        symmetric=(float(free[1]), float(free[2])),
        covariance=covariance[:3, :3],
        residual_sd_1_m=variance**0.5,
        autocorrelation=lagged,
        samples=len(curvature),
    )


@dataclass(frozen=True)
class TimeConstant:
    """A time constant with its standard deviation and 90 % interval.

    Near tau1 = tau2 the distribution is folded and lopsided: trust the interval, not the deviation.
    """

    value: float
    sd: float
    interval: tuple[float, float]


def time_constants(s: float, q: float, covariance: Array) -> tuple[TimeConstant, TimeConstant]:
    """Return tau1 and tau2, given s, q (negative, too) and their covariance.

    The Gaussian of (s, q) is carried through tau = s (1 +- sqrt(q)) on a grid of equal probabilities, which
    stays finite where the derivative of the square root does not. Points with q < 0 are moved to the
    likeliest point with q = 0, as the fit itself would be; where q = 0 is possible (5 %), an interval holds
    that of equal time constants, too.
    """
    from scipy.special import ndtri

    nodes = ndtri((np.arange(STEP_TEST.grid) + 0.5) / STEP_TEST.grid)
    # 1e-18 keeps the factor where a value has no error
    root = np.linalg.cholesky(covariance + np.diag([1e-18, 1e-18]))
    u, v = np.meshgrid(nodes, nodes, indexing="ij")
    # of s on q: where q is moved to 0, s moves along with it
    regression = covariance[0, 1] / covariance[1, 1] if covariance[1, 1] > 0 else 0.0
    squares = q + root[1, 0] * u + root[1, 1] * v
    means = s + root[0, 0] * u - regression * np.minimum(squares, 0.0)
    roots = np.sqrt(np.clip(squares, 0.0, STEP_TEST.largest_q))
    mean, best = s - regression * min(q, 0.0), float(np.sqrt(np.clip(q, 0.0, STEP_TEST.largest_q)))
    equal = s - regression * q
    reach = 1.645 * float(np.sqrt(max(covariance[0, 0] - regression * covariance[0, 1], 0.0)))
    found = []
    for sign in (1, -1):
        centre, spread = mean * (1 + sign * best), means * (1 + sign * roots)
        low, high = (float(v) for v in np.quantile(spread, [0.05, 0.95]))
        if (squares < 0).mean() > 0.05:
            low, high = min(low, equal - reach), max(high, equal + reach)
        found.append(TimeConstant(centre, float(np.sqrt(((spread - centre) ** 2).mean())), (low, high)))
    return found[0], found[1]


def fit_steps(tests: Sequence[StepTest], *, fit_delay: bool = False) -> tuple[StepFit, ...]:
    """Fit (14) to every test."""
    return tuple(fit_step(test, fit_delay=fit_delay) for test in tests)

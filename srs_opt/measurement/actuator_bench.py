"""What a series of step tests says together: C0 over pressure, time constants by pressure and condition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.fit_settings import STEP_TEST
from srs_opt.measurement.records import CONDITIONS
from srs_opt.measurement.steps import StepFit, time_constants
from srs_opt.measurement.weighted_mean import Mean, weighted_mean


@dataclass(frozen=True)
class TimeConstants:
    """Time constants of the steps of one condition (and one pressure; None: all); 90 % intervals."""

    condition: str
    pressure_kpa: float | None
    tau1_s: float
    tau1_sd_s: float
    tau1_interval_s: tuple[float, float]
    tau2_s: float
    tau2_sd_s: float
    tau2_interval_s: tuple[float, float]
    tests: int


@dataclass(frozen=True)
class CurveValue:
    """C0 at one pressure: mean over its tests, with its standard deviation."""

    pressure_kpa: float
    c0_1_m: float
    sd_1_m: float


@dataclass(frozen=True)
class CurvatureOverPressure:
    """C0 = slope times pressure, through the origin; a curve where the tests ask for it.

    Attributes
    ----------
    condition : {"lifted", "ground"}
    slope_1_m_kpa : Mean
    lack_of_fit_p : float or None
        Probability of a trend of C0/pressure with pressure at least this strong if C0 were proportional to
        pressure; None with fewer than three tests or a single pressure. Small: not proportional.
    curve : tuple of CurveValue
        C0 at every pressure, where it is not proportional (`StepTestSettings.trend_level`); else empty.
    """

    condition: str
    slope_1_m_kpa: Mean
    lack_of_fit_p: float | None
    curve: tuple[CurveValue, ...] = ()


@dataclass(frozen=True)
class ActuatorBench:
    """Everything the step tests tell, by condition."""

    curvature: tuple[CurvatureOverPressure, ...]
    time_constants: tuple[TimeConstants, ...]

    def slope(self, condition: str) -> Mean:
        """Return C0 over pressure in one condition."""
        return next(c.slope_1_m_kpa for c in self.curvature if c.condition == condition)

    def constants(self, condition: str, pressure_kpa: float | None = None) -> TimeConstants:
        """Return the time constants of one condition, at one pressure or (None) over all."""
        both = (condition, pressure_kpa)
        return next(t for t in self.time_constants if (t.condition, t.pressure_kpa) == both)


def combine_steps(fits: Sequence[StepFit]) -> ActuatorBench:
    """Combine step fits by condition and pressure.

    Raises
    ------
    InputError
        If there is no fit.
    """
    if not fits:
        raise InputError("no step tests (bench/steps.csv) to combine")
    curvature, constants = [], []
    for condition in CONDITIONS:
        group = [f for f in fits if f.condition == condition]
        if not group:
            continue
        curvature.append(_curvature(condition, group))
        constants.append(_constants(condition, None, group))
        for pressure in sorted({f.pressure_kpa for f in group}):
            same = [f for f in group if f.pressure_kpa == pressure]
            constants.append(_constants(condition, pressure, same))
    return ActuatorBench(tuple(curvature), tuple(constants))


def _curvature(condition: str, fits: list[StepFit]) -> CurvatureOverPressure:
    pressure = np.array([f.pressure_kpa for f in fits])
    # C_0 of (14) is proportional to pressure in the model: one slope per test
    slopes = np.array([abs(f.c0_1_m) for f in fits]) / pressure
    sds = np.array([f.c0_sd_1_m for f in fits]) / pressure
    p_value = None
    if len(fits) >= 3 and np.ptp(pressure) > 0:
        from scipy.stats import linregress

        line = linregress(pressure, slopes)
        p_value = float(line.pvalue) if np.isfinite(line.pvalue) else None
    sds = np.maximum(sds, 1e-12)
    curve: tuple[CurveValue, ...] = ()
    if p_value is not None and p_value < STEP_TEST.trend_level:
        groups = [(p, pressure == p) for p in sorted(set(pressure.tolist()))]
        means = [(p, weighted_mean(slopes[own], sds[own])) for p, own in groups]
        curve = tuple(CurveValue(p, p * m.value, p * m.sd) for p, m in means)
    return CurvatureOverPressure(condition, weighted_mean(slopes, sds), p_value, curve)


def _constants(condition: str, pressure: float | None, fits: list[StepFit]) -> TimeConstants:
    """Average in (s, q), where equal time constants are no special case."""
    pairs = np.array([f.symmetric for f in fits])
    sds = np.array([np.sqrt(np.diagonal(f.covariance)[1:]) for f in fits])
    s, q = (weighted_mean(pairs[:, i], np.maximum(sds[:, i], 1e-9)) for i in range(2))
    correlations = [
        f.covariance[1, 2] / max(np.sqrt(f.covariance[1, 1] * f.covariance[2, 2]), 1e-300) for f in fits
    ]
    # short of 1, or the covariance would not be positive definite
    mixed = float(np.clip(np.mean(correlations), -0.999, 0.999)) * s.sd * q.sd
    covariance = np.array([[s.sd**2, mixed], [mixed, q.sd**2]])
    one, two = time_constants(s.value, q.value, covariance)
    return TimeConstants(
        condition=condition,
        pressure_kpa=pressure,
        tau1_s=one.value,
        tau1_sd_s=one.sd,
        tau1_interval_s=one.interval,
        tau2_s=two.value,
        tau2_sd_s=two.sd,
        tau2_interval_s=two.interval,
        tests=len(fits),
    )

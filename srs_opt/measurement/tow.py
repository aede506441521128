"""Tow tests: force over speed gives Coulomb friction (intercept) and viscous friction (slope)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from srs_opt.errors import InputError
from srs_opt.measurement.friction import FrictionEstimate
from srs_opt.measurement.records import TowTest
from srs_opt.robot import Robot


@dataclass(frozen=True)
class TowLine:
    """Force = coulomb_n + viscous_n_s_m |speed|; the slope is None when only one speed was towed.

    Standard deviations are those of the estimates; None when there are too few tows to tell.
    """

    coulomb_n: float
    coulomb_sd_n: float | None
    viscous_n_s_m: float | None
    viscous_sd_n_s_m: float | None
    residual_sd_n: float | None
    tows: int


@dataclass(frozen=True)
class TowResult:
    """What towing tells: lines with and without the tether, their difference, sliding friction.

    Attributes
    ----------
    with_tether, without_tether : TowLine or None
    tether : TowLine or None
        The difference of the two: what the tether adds.
    sliding : FrictionEstimate or None
        Tangential sliding coefficient from the intercept without tether.
    """

    with_tether: TowLine | None
    without_tether: TowLine | None
    tether: TowLine | None
    sliding: FrictionEstimate | None


def analyse_tow(tests: Sequence[TowTest], robot: Robot) -> TowResult:
    """Fit force over speed, apart for tows with and without the tether.

    Raises
    ------
    InputError
        If there is no test.
    """
    if not tests:
        raise InputError("no tow tests (bench/tow.csv) to analyse")
    lines = {kind: _line([t for t in tests if t.with_tether is kind]) for kind in (True, False)}
    with_tether, without = lines[True], lines[False]
    sliding = None
    if without is not None:
        weight = robot.links * robot.link_mass_kg * robot.gravity_m_s2
        error = None if without.coulomb_sd_n is None else without.coulomb_sd_n / weight
        scatter = None if without.residual_sd_n is None else without.residual_sd_n / weight
        mean = without.coulomb_n / weight
        sliding = FrictionEstimate("tangential", "sliding", mean, scatter, error, without.tows)
    difference = None if with_tether is None or without is None else _difference(with_tether, without)
    return TowResult(with_tether, without, difference, sliding)


def _line(tests: list[TowTest]) -> TowLine | None:
    if not tests:
        return None
    speed = np.abs([t.speed_m_s for t in tests])
    force = np.array([abs(t.force_n) for t in tests])
    # one speed tells no slope
    several = float(np.ptp(speed)) > 1e-6
    design = np.column_stack([np.ones(len(speed)), speed]) if several else np.ones((len(speed), 1))
    values = np.linalg.lstsq(design, force, rcond=None)[0]
    freedom = len(force) - design.shape[1]
    slope = float(values[1]) if several else None
    if freedom < 1:
        return TowLine(float(values[0]), None, slope, None, None, len(force))
    variance = float(((force - design @ values) ** 2).sum()) / freedom
    sds = np.sqrt(np.diagonal(np.linalg.inv(design.T @ design)) * variance)
    slope_sd = float(sds[1]) if several else None
    return TowLine(float(values[0]), float(sds[0]), slope, slope_sd, variance**0.5, len(force))


def _difference(a: TowLine, b: TowLine) -> TowLine:
    slope = None
    if a.viscous_n_s_m is not None and b.viscous_n_s_m is not None:
        slope = a.viscous_n_s_m - b.viscous_n_s_m
    return TowLine(
        coulomb_n=a.coulomb_n - b.coulomb_n,
        coulomb_sd_n=_root_sum(a.coulomb_sd_n, b.coulomb_sd_n),
        viscous_n_s_m=slope,
        viscous_sd_n_s_m=None if slope is None else _root_sum(a.viscous_sd_n_s_m, b.viscous_sd_n_s_m),
        residual_sd_n=_root_sum(a.residual_sd_n, b.residual_sd_n),
        tows=a.tows + b.tows,
    )


def _root_sum(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else (a * a + b * b) ** 0.5

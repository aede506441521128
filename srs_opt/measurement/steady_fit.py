"""A steady gait fitted to a track: the same shape, turned and carried on from cycle to cycle.

With positions as complex numbers, a steady gait of period T and turn rate W moves every marker by

    z_i(t) = e^{iWt} (v g(t) + s_i(t)),   g(t) = (1 - e^{-iWt})/(iW)   (g = t when W = 0),

s_i periodic (a Fourier sum). It is linear in v and s_i for a given W, uses every sample of every phase, needs
no interpolation when samples and period do not match, and lost markers are simply left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from srs_opt.measurement.fit_settings import STEADY
from srs_opt.measurement.records import Array

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class SteadyFit:
    """A fitted steady gait.

    Attributes
    ----------
    turn_rate_rad_s : float
    period_s : float
    drift : complex
        v of the model, m/s.
    coefficients : ndarray of complex, shape (2 H + 1,)
        Fourier sum (harmonics -H .. H) of the markers' mean, in the turning frame, m.
    origin_s : float
        Time that counts as t = 0 in the model.
    variance_m2 : float
        Mean square residual per coordinate.
    freedom : float
        Coordinates minus unknowns.
    """

    turn_rate_rad_s: float
    period_s: float
    drift: complex
    coefficients: Complex
    origin_s: float
    variance_m2: float
    freedom: float

    def _mean_shape(self) -> Complex:
        """Return the markers' mean in the turning frame over one cycle."""
        h = len(self.coefficients) // 2
        phase = np.arange(STEADY.fine) / STEADY.fine * 2 * np.pi
        return np.asarray(np.exp(1j * np.outer(phase, np.arange(-h, h + 1))) @ self.coefficients)

    @property
    def speed_m_s(self) -> float:
        """Return |turn rate| times mean distance from the centre; straight: displacement over time."""
        # |W| times the distance from the centre, |v/(iW) + s|, in a form that is regular at W = 0
        return float(np.abs(self.drift + 1j * self.turn_rate_rad_s * self._mean_shape()).mean())

    @property
    def curvature_1_m(self) -> float:
        """Return turn rate over speed: the inverse of the signed radius."""
        return self.turn_rate_rad_s / self.speed_m_s if self.speed_m_s > 0 else 0.0

    @property
    def centre_m(self) -> complex | None:
        """Return the centre of rotation (x + iy), None at turn rate 0."""
        rate = self.turn_rate_rad_s
        return None if rate == 0 else -self.drift / (1j * rate)


def fit_steady(time_s: Array, tracks: Complex, period_s: float, harmonics: int | None = None) -> SteadyFit:
    """Fit a steady gait.

    Parameters
    ----------
    time_s : ndarray, shape (T,)
    tracks : ndarray of complex, shape (T, P)
        Positions x + iy of P markers, NaN where lost.
    period_s : float
        Period of the gait (known from the valves).
    harmonics : int
        Highest harmonic of the cycle's shape; default `SteadyMotionSettings.harmonics`.
    """
    from scipy.optimize import minimize_scalar

    harmonics = STEADY.harmonics if harmonics is None else harmonics
    # time from the middle, so that turn rate and place do not trade off
    origin = float(time_s.mean())
    t = time_s - origin
    orders = np.arange(-harmonics, harmonics + 1)
    waves = np.exp(2j * np.pi / period_s * np.outer(t, orders))
    parts = [
        _Part(t[seen], z[seen], waves[seen]) for z in tracks.T for seen in [np.isfinite(z)] if seen.any()
    ]
    start = turn_rate_guess(time_s, tracks, period_s)
    # within half a radian of what the guess tells: further away the cost has side minima
    width = 0.5 / max(period_s, float(np.ptp(t)) / 4)
    cost = partial(_cost, parts)
    found = minimize_scalar(
        cost, bounds=(start - width, start + width), method="bounded", options={"xatol": 1e-9}
    )
    rate = float(found.x)
    drift = _drift(parts, rate)
    shapes = np.array([part.coefficients(rate, drift) for part in parts])
    # turn rate, drift (2), and a complex amplitude per harmonic and marker
    count = 2 * sum(len(part.t) for part in parts)
    freedom = count - 3 - 2 * shapes.size
    return SteadyFit(
        turn_rate_rad_s=rate,
        period_s=period_s,
        drift=drift,
        coefficients=shapes.mean(axis=0),
        origin_s=origin,
        variance_m2=float(found.fun) / max(freedom, 1),
        freedom=freedom,
    )


class _Part:
    """One marker's samples, with the periodic part of its motion projected out (independent of W)."""

    def __init__(self, t: Array, z: Complex, waves: Complex) -> None:
        self.t, self.z = t, z
        # once per marker: the waves do not depend on the turn rate that is searched
        self.basis, self.triangle = np.linalg.qr(waves)

    def leftover(self, values: Complex) -> Complex:
        return np.asarray(values - self.basis @ (self.basis.conj().T @ values))

    def reduced(self, rate: float) -> tuple[Complex, Complex]:
        """Return the samples in the turning frame and the column of the drift, both without periodic part."""
        back = np.exp(-1j * rate * self.t)
        return self.leftover(back * self.z), self.leftover(_carry(rate, self.t))

    def coefficients(self, rate: float, drift: complex) -> Complex:
        target = np.exp(-1j * rate * self.t) * self.z - drift * _carry(rate, self.t)
        return np.asarray(np.linalg.lstsq(self.triangle, self.basis.conj().T @ target, rcond=None)[0])


def _carry(rate: float, t: Array) -> Complex:
    """Return g(t) = (1 - e^{-iWt})/(iW), regular at W = 0."""
    half = rate * t / 2
    # (1 - e^{-2ih})/(2ih) = e^{-ih} sin(h)/h; numpy's sinc has pi in it
    return np.asarray(t * np.exp(-1j * half) * np.sinc(half / np.pi))


def _sums(parts: list[_Part], rate: float) -> tuple[float, complex, float]:
    square, product, norm = 0.0, 0.0 + 0.0j, 0.0
    for part in parts:
        y, g = part.reduced(rate)
        square += float(np.vdot(y, y).real)
        product += complex(np.vdot(g, y))
        norm += float(np.vdot(g, g).real)
    return square, product, norm


def _cost(parts: list[_Part], rate: float) -> float:
    square, product, norm = _sums(parts, rate)
    # what is left of the samples after the best drift (variable projection)
    return square - abs(product) ** 2 / max(norm, 1e-300)


def _drift(parts: list[_Part], rate: float) -> complex:
    _, product, norm = _sums(parts, rate)
    return product / max(norm, 1e-300)


def turn_rate_guess(time_s: Array, tracks: Complex, period_s: float) -> float:
    """Return the turn rate that best maps the markers onto themselves one cycle later.

    Several markers turn about their mean; a single one only shows the turning of its own displacement.
    """
    now, later = _at(time_s, tracks, 0.0), _at(time_s, tracks, period_s)
    if tracks.shape[1] > 1:
        # a marker that is lost at one end would shift the means against each other
        both = np.where(np.isfinite(now) & np.isfinite(later), 1.0, np.nan)
        a = now * both - np.nanmean(_safe(now * both), axis=1, keepdims=True)
        b = later * both - np.nanmean(_safe(later * both), axis=1, keepdims=True)
        # in the complex plane the best rotation is the argument of this sum
        turn = np.nansum(np.conj(a) * b)
    else:
        step = later - now
        after = _at(time_s, step, period_s)
        turn = np.nansum(np.conj(step) * after)
    return float(np.angle(turn)) / period_s if turn != 0 else 0.0


def _safe(values: Complex) -> Complex:
    """Avoid means over nothing: a row without any value becomes zero."""
    empty = np.isnan(values).all(axis=1, keepdims=True)
    return np.where(empty, 0.0, values)


def _at(time_s: Array, tracks: Complex, shift_s: float) -> Complex:
    """Return the tracks `shift_s` later, interpolated; NaN beyond the end and next to lost samples."""
    if shift_s == 0:
        return tracks
    wanted = time_s + shift_s
    right = np.clip(np.searchsorted(time_s, wanted - 1e-9), 1, len(time_s) - 1)
    share = (wanted - time_s[right - 1]) / (time_s[right] - time_s[right - 1])
    values = tracks[right - 1] * (1 - share)[:, None] + tracks[right] * share[:, None]
    values[wanted > time_s[-1] + 1e-9] = np.nan
    return np.asarray(values)

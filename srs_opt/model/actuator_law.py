"""The law of a pneumatic segment, the paper's (13)-(15), in every form that is used; one place for all.

Two lags in series between the valve and the curvature kappa, with the target K (where kappa settles while
the valve is held):

    kappa'' = (K - kappa)/(tau_1 tau_2) - (1/tau_1 + 1/tau_2) kappa'          (15)

- `acceleration`: the differential equation itself;
- `decay`, `held`: its solution from any state while the valve is held;
- `step_response`: the same from rest for K = 1, (14), as bench tests are fitted with it;
- `periodic_curvature`: its periodic solution under a square wave of switches, (13).

The last one needs no settling: between switches the law is linear, so the periodic response is the valve's
own value plus one decaying transient per switch, each summed over all past cycles as a geometric series. The
dependence on switch times, frequency and pressure is exact. Seen from a fixed instant, the curvature's rate
has a kink when a switch passes. Two remedies: phases that end at switches in a fixed order (`turns`), or
switches spread over a narrow hat (`half_width`, about one element of the mesh; it weakens the k-th harmonic
by sinc^2(k half_width), 0.05 % for k = 1 and 0.0125).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from srs_opt.model.parameters import Parameters

# of (1/tau_1 - 1/tau_2) t/2: below it sinh(z)/z by its series, whose first term left out is 1e-13 there
_SERIES_RADIUS = 0.1
_APART = 1e-3  # time constants closer than this (relative) are spread by it; the error is its square


def acceleration(target: ca.SX, kappa: ca.SX, dkappa: ca.SX, tau1: ca.SX, tau2: ca.SX) -> ca.SX:
    """Return kappa'' of (15), 1/(m s^2)."""
    # with the kappa that (15) has lost in print
    return (target - kappa) / (tau1 * tau2) - (1 / tau1 + 1 / tau2) * dkappa


def decay(time: ca.SX, tau1: ca.SX, tau2: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Return the impulse response phi(t) of the two time constants and its derivative.

    phi = (exp(-t/tau_2) - exp(-t/tau_1)) / (1/tau_1 - 1/tau_2), regular for tau_1 = tau_2 (a series
    there) and without overflow however unlike the two are.
    """
    mean = (1 / tau1 + 1 / tau2) / 2
    # phi = t exp(-mean t) sinh(z)/z is even in z: which constant is the larger does not matter
    z = (1 / tau1 - 1 / tau2) / 2 * time
    slow, fast = ca.exp(-time / tau1), ca.exp(-time / tau2)
    small = ca.fabs(z) < _SERIES_RADIUS
    # both branches are evaluated and differentiated: the unused one must neither divide by zero nor overflow
    safe = ca.if_else(small, 1.0, z)
    z2 = ca.if_else(small, z * z, 0.0)
    series = 1 + z2 / 6 * (1 + z2 / 20 * (1 + z2 / 42 * (1 + z2 / 72)))  # sinh(z)/z
    phi = time * ca.if_else(small, ca.exp(-mean * time) * series, (fast - slow) / (2 * safe))
    # phi' = exp(-mean t) cosh(z) - mean phi, the product written as a sum of decays that cannot overflow
    return phi, (slow + fast) / 2 - mean * phi


def held(
    target: ca.SX, kappa: ca.SX, dkappa: ca.SX, time: ca.SX, tau1: ca.SX, tau2: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Return curvature and rate after `time` at a held valve: (15) solved from any state."""
    phi, dphi = decay(time, tau1, tau2)
    # the target is constant while the valve is held, so the offset obeys (15) without its input
    offset = kappa - target
    stay = dphi + (1 / tau1 + 1 / tau2) * phi  # what is left of an offset at rest, 1 at time 0
    return target + stay * offset + phi * dkappa, dphi * dkappa - phi / (tau1 * tau2) * offset


def step_response(time_s: NDArray[np.float64], s: float, q: float) -> NDArray[np.float64]:
    """Return the unit response of (14) from rest: 1 - e^{-at} (cosh dt + a sinh(dt)/d), d^2 = a^2 q.

    With a = 1/(s (1-q)); defined for q < 1, negative q (a pair of complex roots) included.
    """
    t = np.maximum(np.asarray(time_s, dtype=float), 0.0)
    # s is the mean of the time constants, sqrt(q) their half difference over it; a is the mean rate
    a = 1 / (s * (1 - q))
    x = a * a * q * t * t
    root = np.sqrt(np.abs(x))
    if q >= 0:
        # exponents are added before exp: cosh and sinh alone would overflow for long times
        slow, fast = np.exp(root - a * t), np.exp(-root - a * t)
        even, odd = (slow + fast) / 2, (slow - fast) / 2
    else:
        even, odd = np.exp(-a * t) * np.cos(root), np.exp(-a * t) * np.sin(root)
    # sinh(x)/x near zero, sin(x)/x alike: the first term left out is 2e-16 there
    near = np.abs(x) < 1e-4
    series = np.exp(-a * t) * (1 + x / 6 * (1 + x / 20))
    odd = np.where(near, series, odd / np.where(near, 1.0, root))
    return np.asarray(1 - even - a * t * odd)


def time_constants(parameters: Parameters) -> tuple[ca.SX, ca.SX]:
    """Return tau_1 and tau_2, kept apart so that the two modes stay distinct."""
    tau1, tau2 = parameters["tau1_s"], parameters["tau2_s"]
    # the weights of the modes divide by tau_1 - tau_2; with the mean kept the error is of second order
    mean, half = (tau1 + tau2) / 2, (tau1 - tau2) / 2
    least = _APART * mean
    spread = ca.if_else(ca.fabs(half) < least, least, half)
    return mean + spread, mean - spread


@dataclass(frozen=True)
class SwitchTrain:
    """The response to a unit step that repeats every period, as a zero-mean function of its age.

    Ages are fractions of the period in [0, 1). A step train alone is not periodic; on- and off-steps
    together are, and the ramp that each leaves behind (a Bernoulli polynomial) cancels in the sum.
    """

    period_s: ca.SX
    tau1: ca.SX
    tau2: ca.SX

    def _modes(self, age: ca.SX) -> list[tuple[ca.SX, ca.SX, ca.SX]]:
        """Return weight, decay time over period and geometric sum of both modes."""
        modes = []
        # partial fractions of (14); 1/(1 - exp(-period/tau)) sums one transient per past cycle
        for mine, other in ((self.tau1, self.tau2), (self.tau2, self.tau1)):
            ratio = mine / self.period_s
            modes.append((mine / (mine - other), ratio, ca.exp(-age / ratio) / (1 - ca.exp(-1 / ratio))))
        return modes

    def value(self, age: ca.SX) -> ca.SX:
        """Return (valve, curvature) at `age`, up to a constant that on and off share."""
        ramp = age - 0.5
        return ca.vertcat(ramp, ramp + sum(w * e for w, _, e in self._modes(age)))

    def derivative(self, age: ca.SX) -> ca.SX:
        """Return the curvature's derivative by age, between switches."""
        return 1 - sum(w * e / r for w, r, e in self._modes(age))

    def once_integrated(self, age: ca.SX) -> ca.SX:
        """Return the integral of the curvature by age, zero mean."""
        ramp = age - 0.5
        # e has mean r over a cycle, which the ramp takes off: the integral is periodic, and minus r of mean
        # zero
        parts = [-r * w * (e + ramp - r) for w, r, e in self._modes(age)]
        # ramp, square and cube are the Bernoulli polynomials B_1, B_2, B_3: periodic integrals of each other
        return (age * age - age + 1 / 6) / 2 + sum(parts)

    def twice_integrated(self, age: ca.SX) -> ca.SX:
        """Return the double integral of (valve, curvature) by age, zero mean."""
        ramp, square = age - 0.5, age * age - age + 1 / 6
        cube = (age - 1.5) * age * age + 0.5 * age
        parts = [r * w * (r * (e + ramp - r) - square / 2) for w, r, e in self._modes(age)]
        return ca.vertcat(cube / 6, cube / 6 + sum(parts))


def _second_difference(function: Callable[[ca.SX], ca.SX], since: ca.SX, half_width: ca.SX) -> ca.SX:
    # the second difference of a double integral is the mean under a hat of this half width
    ages = [since + half_width, since, since - half_width]
    # ages repeat every period: their fractional part
    after, middle, before = (function(a - ca.floor(a)) for a in ages)
    return (after - 2 * middle + before) / half_width**2


def periodic_curvature(
    parameters: Parameters,
    target_high: ca.SX,
    target_low: ca.SX,
    at: ca.SX,
    switches: tuple[ca.SX, ca.SX],
    half_width: ca.SX | None = None,
    turns: ca.SX | None = None,
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Return curvature (1/m), its rate (1/(m s)) and valve state of one segment.

    Parameters
    ----------
    target_high, target_low : SX
        Curvatures at which the segment settles for S = +1 and S = -1, 1/m.
    at : SX
        Time as a fraction of the period.
    switches : (on, off)
        SX (K, 1) each, fractions of the period (any real numbers; on < off < next on).
    half_width : SX, optional
        Half width of the hat over which a switch is spread, fraction of the period. Then the result is
        twice continuously differentiable in all arguments.
    turns : SX (2 K, 1), optional
        Whole cycles that make each switch the last one before `at` (all on, then all off): switches are
        sharp and the result is smooth as long as the order of the switches stays as it is.
    """
    period = 1 / parameters["frequency_hz"]
    train = SwitchTrain(period, *time_constants(parameters))
    on, off = (ca.vertsplit(s) for s in switches)
    # share of the period with S = +1: what the zero-mean trains leave out
    mean = sum((b - a for a, b in zip(on, off)), ca.SX(0))
    shape, rate = ca.vertcat(mean, mean), ca.SX(0)
    for index, (switch, sign) in enumerate([(s, 1.0) for s in on] + [(s, -1.0) for s in off]):
        since = at - switch
        if turns is not None:
            age = since - turns[index]
            value, derivative = train.value(age), train.derivative(age)
        else:
            assert half_width is not None
            value = _second_difference(train.twice_integrated, since, half_width)
            derivative = _second_difference(train.once_integrated, since, half_width)
        shape, rate = shape - sign * value, rate - sign * derivative
    span = target_high - target_low
    # the unit wave becomes S = -1 or +1; rates are by the fraction of the period, hence over the period
    return target_low + span * shape[1], span * rate / period, 2 * shape[0] - 1

"""The periodic curvature of a segment under square-wave valves, in closed form (the paper's (13)-(15)).

Between switches the actuator is linear, so the periodic response is the valve's own value plus one
decaying transient per switch, each summed over all past cycles as a geometric series. No state is spent
on the actuators, and the dependence on switch times, frequency and pressure is exact.

Seen from a fixed instant, the curvature's rate has a kink when a switch passes. Two remedies: phases that
end at switches in a fixed order (`turns`), or switches spread over a narrow hat (`half_width`, about one
element of the mesh; it weakens the k-th harmonic by sinc^2(k half_width), 0.05 % for k = 1 and 0.0125).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from srs_opt.model.parameters import Parameters

_APART = 1e-3  # time constants closer than this (relative) are spread by it; the error is its square


def time_constants(parameters: Parameters) -> tuple[ca.SX, ca.SX]:
    """Return tau_1 and tau_2, kept apart so that the two modes stay distinct."""
    tau1, tau2 = parameters["tau1_s"], parameters["tau2_s"]
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
        for mine, other in ((self.tau1, self.tau2), (self.tau2, self.tau1)):
            ratio = mine / self.period_s
            modes.append((mine / (mine - other), ratio, ca.exp(-age / ratio) / (1 - ca.exp(-1 / ratio))))
        return modes

    def value(self, age: ca.SX) -> ca.SX:
        """Return (valve, curvature) at `age`, up to a constant that on and off share."""
        ramp = age - 0.5
        return ca.vertcat(ramp, ramp + sum(w * e for w, _, e in self._modes(age)))

    def slope(self, age: ca.SX) -> ca.SX:
        """Return the curvature's derivative by age, between switches."""
        return 1 - sum(w * e / r for w, r, e in self._modes(age))

    def once_integrated(self, age: ca.SX) -> ca.SX:
        """Return the integral of the curvature by age, zero mean."""
        ramp = age - 0.5
        parts = [-r * w * (e + ramp - r) for w, r, e in self._modes(age)]
        return (age * age - age + 1 / 6) / 2 + sum(parts)

    def twice_integrated(self, age: ca.SX) -> ca.SX:
        """Return the double integral of (valve, curvature) by age, zero mean."""
        ramp, square = age - 0.5, age * age - age + 1 / 6
        cube = (age - 1.5) * age * age + 0.5 * age
        parts = [r * w * (r * (e + ramp - r) - square / 2) for w, r, e in self._modes(age)]
        return ca.vertcat(cube / 6, cube / 6 + sum(parts))


def _second_difference(function: Callable[[ca.SX], ca.SX], since: ca.SX, half_width: ca.SX) -> ca.SX:
    ages = [since + half_width, since, since - half_width]
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
    mean = sum((b - a for a, b in zip(on, off)), ca.SX(0))
    shape, rate = ca.vertcat(mean, mean), ca.SX(0)
    for index, (switch, sign) in enumerate([(s, 1.0) for s in on] + [(s, -1.0) for s in off]):
        since = at - switch
        if turns is not None:
            age = since - turns[index]
            value, slope = train.value(age), train.slope(age)
        else:
            assert half_width is not None
            value = _second_difference(train.twice_integrated, since, half_width)
            slope = _second_difference(train.once_integrated, since, half_width)
        shape, rate = shape - sign * value, rate - sign * slope
    span = target_high - target_low
    return target_low + span * shape[1], span * rate / period, 2 * shape[0] - 1
